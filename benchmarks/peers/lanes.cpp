// SPDX-License-Identifier: Apache-2.0
// Lanes written by hand: a packet of members in vector types of GCC and Clang, its state in registers and on the stack.
// peer_hand_lanes.py puts the equations of one vehicle, and the step of one method, in the places of the words below.
#include <cmath>
#include <cstring>

template <class real, int lanes> struct Types {
    typedef real Lane __attribute__((vector_size(lanes * sizeof(real))));
};

#if defined(__has_builtin)
#if __has_builtin(__builtin_elementwise_sqrt) && __has_builtin(__builtin_elementwise_abs)
#define ELEMENTWISE
#endif
#endif

template <class real, int lanes, class Lane> static inline __attribute__((always_inline)) Lane root_of(Lane x) {
#ifdef ELEMENTWISE
    return __builtin_elementwise_sqrt(x);
#else
    for (int i = 0; i < lanes; ++i) x[i] = std::sqrt(x[i]);
    return x;
#endif
}

template <class real, int lanes, class Lane> static inline __attribute__((always_inline)) Lane size_of(Lane x) {
#ifdef ELEMENTWISE
    return __builtin_elementwise_abs(x);
#else
    return x < real(0) ? -x : x;
#endif
}

template <class real, class Lane> static inline __attribute__((always_inline)) Lane limited(Lane x, real limit) {
    const Lane high = Lane{} + limit;
    x = x < -high ? -high : x;
    return x > high ? high : x;
}

template <class real, int lanes, class Lane>
static inline __attribute__((always_inline)) void rates(const Lane *state, const Lane *wrench, Lane *rate) {
    const auto root = [](Lane x) { return root_of<real, lanes, Lane>(x); };
    const auto absolute = [](Lane x) { return size_of<real, lanes, Lane>(x); };
    (void)root, (void)absolute, (void)wrench;
RATES
}

// The wrench of a packet's held commands.
template <class real, int lanes, class Lane>
static inline __attribute__((always_inline)) void thrusts(const Lane *command, Lane *wrench) {
    (void)command, (void)wrench;
THRUSTS
}

// Where thrusters are some time after `place`, on their way to their commands, and their wrench there.
template <class real, int lanes, class Lane>
static inline __attribute__((always_inline)) void lagged(const Lane *command, const Lane *place, real fade, Lane *wrench) {
    Lane later[THRUSTERS + 1];
    for (int i = 0; i < THRUSTERS; ++i) later[i] = command[i] + fade * (place[i] - command[i]);
    thrusts<real, lanes, Lane>(later, wrench);
}

template <class real, int lanes>
static void advance(const real *start, real *end, double step, long steps, long packets) {
    typedef typename Types<real, lanes>::Lane Lane;
    const real h = real(step);
FADES
    for (long i = 0; i < packets; ++i) {
        Lane row[ROW], y[NUMBERS], wrench[6] = {};
        std::memcpy(row, start + i * ROW * lanes, sizeof row);
        for (int j = 0; j < NUMBERS; ++j) y[j] = row[j];
        const Lane *command = row + NUMBERS;
        Lane *place = row + NUMBERS + THRUSTERS;
        (void)command, (void)place;
        thrusts<real, lanes, Lane>(command, wrench);
        for (long k = 0; k < steps; ++k) {
STEP
        }
        for (int j = 0; j < NUMBERS; ++j) row[j] = y[j];
        std::memcpy(end + i * ROW * lanes, row, sizeof row);
    }
}

extern "C" void run(const REAL *start, REAL *end, double step, long steps, long packets) {
    advance<REAL, LANES>(start, end, step, steps, packets);
}
