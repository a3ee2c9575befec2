# SPDX-License-Identifier: Apache-2.0
"""Files with the headers and shapes that ocean models, radars and charts write, and one current for all: a turning Earth.

The current is that of a solid body about an axis, times a linear profile of depth and of time. Its parts to the east and the
north are known in closed form at each latitude and longitude.
"""

import netCDF4
import numpy as np
import pyproj

# Turns about an axis through this place [deg], by this much at a distance of one radius of the Earth [m/s].
AXIS, SPEED = np.deg2rad((72.0, 30.0)), 2.0
# By how much of itself it falls per meter of depth, and grows per second.
PER_METER, PER_SECOND = 1.0 / 400.0, 1.0 / 864000.0


def current(latitude, longitude, depth=0.0, seconds=0.0):
    """Parts to the east and to the north [m/s] at places [deg], depths [m] and times [s] after the first of a file."""
    lat, lon = np.deg2rad(latitude), np.deg2rad(longitude)
    axis = np.array([np.cos(AXIS[0]) * np.cos(AXIS[1]), np.cos(AXIS[0]) * np.sin(AXIS[1]), np.sin(AXIS[0])])
    place = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
    flow = SPEED * np.cross(axis, place)
    east = flow[..., 1] * np.cos(lon) - flow[..., 0] * np.sin(lon)
    north = flow[..., 2] * np.cos(lat) - np.sin(lat) * (flow[..., 0] * np.cos(lon) + flow[..., 1] * np.sin(lon))
    much = (1.0 - PER_METER * np.asarray(depth)) * (1.0 + PER_SECOND * np.asarray(seconds))
    return east * much, north * much


class Writer:
    """A NetCDF file: dimensions, and variables with their attributes."""

    def __init__(self, path, form="NETCDF3_64BIT_OFFSET", **attributes):
        self.file = netCDF4.Dataset(path, "w", format=form)
        self.file.setncatts(attributes)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.file.close()

    def add(self, name, dims, values, kind="f4", fill=None, /, **attributes):
        values = np.ma.masked_invalid(values) if fill is not None else np.asarray(values)
        for dim, size in zip(dims, np.shape(values), strict=True):
            if dim not in self.file.dimensions:
                self.file.createDimension(dim, size)
        made = self.file.createVariable(name, kind, dims, fill_value=fill)
        made.setncatts(attributes)
        made[...] = values


def turned_places(projection, rows, columns, spacing, origin, angle):
    """Latitudes and longitudes of nodes of a grid that is turned in a projection; rows and columns may have parts."""
    j, i = np.meshgrid(rows, columns, indexing="ij")
    x = origin[0] + spacing * (i * np.cos(angle) - j * np.sin(angle))
    y = origin[1] + spacing * (i * np.sin(angle) + j * np.cos(angle))
    longitude, latitude = projection(x, y, inverse=True)
    return latitude, longitude


def angle_of(projection, rows, columns, spacing, origin, angle):
    """Angle [rad] from the east to the rows of such a grid, to the left, by a geodesic along each."""
    before, after = (
        turned_places(projection, rows, np.asarray(columns) + d, spacing, origin, angle) for d in (-0.01, 0.01)
    )
    return along(*before, *after)


def along(south, west, north, east):
    """Angle [rad] from the east to a short line, to the left, at its middle: latitudes and longitudes of both ends."""
    there, back, _ = pyproj.Geod(ellps="WGS84").inv(west, south, east, north)
    return np.deg2rad(90.0 - there - 0.5 * ((back + 180.0 - there + 180.0) % 360.0 - 180.0))


ROWS, COLUMNS, LEVELS = 14, 18, 12
NORDIC = {"spacing": 4000.0, "origin": (-20000.0, -2520000.0), "angle": 0.7}
STEREO = pyproj.Proj(proj="stere", lat_0=90, lat_ts=60, lon_0=10, ellps="WGS84")


def stretching(levels, theta_s=6.0, theta_b=0.4):
    """s and C(s) of the levels of ROMS: 4 of its stretching functions."""
    s = (np.arange(levels) + 0.5) / levels - 1.0
    C = (1.0 - np.cosh(theta_s * s)) / (np.cosh(theta_s) - 1.0)
    return s, (np.exp(theta_b * C) - 1.0) / (1.0 - np.exp(-theta_b))


def heights(transform, s, C, hc, h, zeta):
    """Heights (k, y, x) of the levels above the mean surface, by the formulas of ROMS' manual."""
    s, C = s[:, None, None], C[:, None, None]
    if transform == 1:
        z = hc * (s - C) + h * C
        return z + zeta * (1.0 + z / h)
    z = (hc * s + h * C) / (hc + h)
    return zeta + (zeta + h) * z


def between(values, axis):
    """Means of neighbors along an axis."""
    low, high = (
        np.take(values, range(*span), axis=axis) for span in ((0, values.shape[axis] - 1), (1, values.shape[axis]))
    )
    return 0.5 * (low + high)


def after(values, axis):
    """Means of each point and the next along an axis; the one after the last goes on in a line."""
    last, before = (np.take(values, [k], axis) for k in (-1, -2))
    return between(np.concatenate([values, 2.0 * last - before], axis), axis)


def roms(path, transform=2, kind="roms", land=True, **grid):
    """A history file of ROMS; kind: "nordic", cut by equal ranges with places of u and v that are zeros, or "croco"."""
    grid = {**NORDIC, **grid}

    def place(dj, di):
        return turned_places(STEREO, np.arange(ROWS) + dj, np.arange(COLUMNS) + di, **grid)

    j, i = np.arange(ROWS, dtype=float), np.arange(COLUMNS, dtype=float)
    lat, lon = place(0.0, 0.0)
    angle = angle_of(STEREO, j, i, **grid)
    h = 120.0 + 4.0 * j[:, None] + 3.0 * i[None, :]
    mask = np.ones(h.shape)
    if land:
        mask[:, -4:] = mask[2:5, 2:4] = 0.0
    seconds = np.array([0.0, 86400.0, 172800.0])
    zeta = 0.4 + 0.01 * i[None, None, :] + 1e-6 * seconds[:, None, None] + 0.0 * j[None, :, None]
    s, C = stretching(LEVELS)
    hc = 30.0
    names = ("eta_rho", "xi_u"), ("eta_v", "xi_rho")
    names = names if kind == "croco" else (("eta_u", "xi_u"), ("eta_v", "xi_v"))
    sets, places = {}, {}
    for letter, axis, dims in (("u", 1, names[0]), ("v", 0, names[1])):
        a, o = place(0.5 * (axis == 0), 0.5 * (axis == 1))
        water = mask * np.roll(mask, -1, axis)
        whole = kind == "nordic"
        cut = (slice(None), slice(None)) if whole else (slice(0, ROWS - (axis == 0)), slice(0, COLUMNS - (axis == 1)))
        bend = angle_of(STEREO, j + 0.5 * (axis == 0), i + 0.5 * (axis == 1), **grid)[cut]
        values = []
        for number, t in enumerate(seconds):
            depth = -heights(transform, s, C, hc, after(h, axis)[cut], after(zeta[number], axis)[cut])
            east, north = current(a[cut], o[cut], depth, t)
            along = (
                east * np.cos(bend) + north * np.sin(bend)
                if letter == "u"
                else north * np.cos(bend) - east * np.sin(bend)
            )
            values.append(np.where(water[cut] > 0.5, along, 0.0 if kind == "croco" else np.nan))
        sets[letter], places[letter] = (dims, np.array(values)), (a[cut], o[cut], water[cut])
    time = "time" if kind == "croco" else "ocean_time"
    with Writer(
        path, "NETCDF4_CLASSIC" if kind == "nordic" else "NETCDF3_64BIT_OFFSET", type="ROMS/TOMS history file"
    ) as made:
        add = made.add
        if kind == "croco":
            made.file.setncatts(
                {
                    "VertCoordType": "NEW",
                    "hc": hc,
                    "hc_expl": "S-coordinate parameter, critical depth",
                    "sc_r": s,
                    "Cs_r": C,
                    "theta_s": 6.0,
                    "theta_b": 0.4,
                }
            )
            for name in ("time", "scrum_time"):
                add(
                    name,
                    ("time",),
                    seconds,
                    "f8",
                    long_name="time since initialization",
                    units="second",
                    field="time, scalar, series",
                    standard_name="time",
                    axis="T",
                )
            for dim, values in (
                ("eta_rho", j + 1.0),
                ("xi_rho", i + 1.0),
                ("xi_u", i[:-1] + 1.5),
                ("eta_v", j[:-1] + 1.5),
            ):
                add(
                    dim,
                    (dim,),
                    values,
                    long_name="dimension of the grid",
                    axis=dim[0].replace("e", "Y").replace("x", "X"),
                )
        else:
            add(
                time,
                (time,),
                seconds + 63587000000.0,
                "f8",
                long_name="time since initialization",
                units="seconds since 0001-01-01 00:00:00",
                calendar="proleptic_gregorian",
                field="time, scalar, series",
            )
            levels = {
                "long_name": "S-coordinate at RHO-points",
                "valid_min": -1.0,
                "valid_max": 0.0,
                "positive": "up",
                "formula_terms": "s: s_rho C: Cs_r eta: zeta depth: h depth_c: hc",
                "field": "s_rho, scalar",
                "standard_name": f"ocean_s_coordinate_g{transform}",
            }
            add("s_rho", ("s_rho",), s, "f8", **levels)
            add("Cs_r", ("s_rho",), C, "f8", long_name="S-coordinate stretching curves at RHO-points")
            add("hc", (), hc, "f8", long_name="S-coordinate parameter, critical depth", units="meter")
            add("Vtransform", (), transform, "i4", long_name="vertical terrain-following transformation equation")
            add(
                "dstart",
                (),
                735960.0,
                "f8",
                long_name="time stamp assigned to model initialization",
                units="days since 0001-01-01",
                calendar="none",
            )
        rho = ("eta_rho", "xi_rho")
        where = {"coordinates": "lon_rho lat_rho"}
        add("h", rho, h, "f8", long_name="bathymetry at RHO-points", units="meter", **where)
        add("angle", rho, angle, "f8", long_name="angle between XI-axis and EAST", units="radians", **where)
        add(
            "mask_rho",
            rho,
            mask,
            "f8",
            long_name="mask on RHO-points",
            flag_values=np.array([0.0, 1.0]),
            flag_meanings="land water",
            **where,
        )
        add(
            "zeta",
            (time, *rho),
            np.where(mask > 0.5, zeta, np.nan),
            "f4",
            1e37,
            long_name="free-surface",
            units="meter",
            time=time,
            **where,
        )
        add(
            "lat_rho",
            rho,
            lat,
            "f8",
            long_name="latitude of RHO-points",
            units="degree_north",
            standard_name="latitude",
        )
        add(
            "lon_rho",
            rho,
            lon,
            "f8",
            long_name="longitude of RHO-points",
            units="degree_east",
            standard_name="longitude",
        )
        for letter, (dims, values) in sets.items():
            a, o, water = places[letter]
            point = {"u": "u-momentum component", "v": "v-momentum component"}[letter]
            for word, numbers, unit in (("lat", a, "degree_north"), ("lon", o, "degree_east")):
                add(
                    f"{word}_{letter}",
                    dims,
                    0.0 * numbers if kind == "nordic" else numbers,
                    "f8",
                    units=unit,
                    standard_name={"lat": "latitude", "lon": "longitude"}[word]
                    + (f"_at_{letter}_location" if kind == "croco" else ""),
                )
            if kind != "croco":
                add(f"mask_{letter}", dims, water, "f8", long_name=f"mask on {letter.upper()}-points")
            own = (
                {"standard_name": f"sea_water_{'xy'[letter == 'v']}_velocity_at_{letter}_location"}
                if kind == "croco"
                else {}
            )
            add(
                letter,
                (time, "s_rho", *dims),
                values,
                "f8",
                None if kind == "croco" else 1e37,
                long_name=point,
                units="meter second-1",
                time=time,
                coordinates=f"lon_{letter} lat_{letter} s_rho {time}",
                **own,
            )


def nemo(path, blocks=((slice(0, 6), slice(0, 5)), (slice(9, 13), slice(10, 16))), shape=(24, 28)):
    """Merged grids of NEMO, of which processors on land are left out: places and values are zeros there."""
    depth = np.array([0.5, 3.0, 8.0, 20.0, 60.0])
    seconds = np.array([0.0, 3600.0, 7200.0])
    # Meridians that draw together, on a grid that is turned and bent.
    grid = {"spacing": 9000.0, "origin": (-60000.0, -2560000.0), "angle": -0.5}
    with Writer(path, "NETCDF4", Conventions="CF-1.6") as made:
        made.add(
            "time_counter",
            ("time_counter",),
            seconds + 3.8e9,
            "f8",
            axis="T",
            standard_name="time",
            calendar="gregorian",
            units="seconds since 1900-01-01 00:00:00",
            time_origin="1900-01-01 00:00:00",
        )
        for letter, name, dj, di in (("u", "vozocrtx", 0.0, 0.5), ("v", "vomecrty", 0.5, 0.0)):
            j, i = np.arange(shape[0]) + dj, np.arange(shape[1]) + di
            lat, lon = turned_places(STEREO, j, i, **grid)
            bend = angle_of(STEREO, j, i, **grid)
            values = []
            for t in seconds:
                east, north = current(lat, lon, depth[:, None, None], t)
                values.append(
                    east * np.cos(bend) + north * np.sin(bend)
                    if letter == "u"
                    else north * np.cos(bend) - east * np.sin(bend)
                )
            values = np.array(values)
            for block in blocks:
                lat[block] = lon[block] = values[(slice(None), slice(None), *block)] = 0.0
            place = f"nav_lat_grid_{letter.upper()}", f"nav_lon_grid_{letter.upper()}"
            made.add(
                place[0],
                ("y", "x"),
                lat,
                "f8",
                standard_name="latitude",
                units="degrees_north",
                nav_model="Default grid",
            )
            made.add(
                place[1],
                ("y", "x"),
                lon,
                "f8",
                standard_name="longitude",
                units="degrees_east",
                nav_model="Default grid",
            )
            made.add(
                f"depth{letter}",
                (f"depth{letter}",),
                depth,
                "f4",
                units="m",
                positive="down",
                axis="Z",
                name=f"depth{letter}",
            )
            made.add(
                name,
                ("time_counter", f"depth{letter}", "y", "x"),
                values,
                "f8",
                1e20,
                units="m/s",
                standard_name=f"sea_water_{'xy'[letter == 'v']}_velocity",
                cell_methods="time: mean",
                online_operation="average",
                coordinates=f"{place[1]} {place[0]} time_counter depth{letter}",
            )


UTM = pyproj.Proj(proj="utm", zone=31, ellps="WGS84")
SYSTEMS = {
    "epsg": {
        "name": "WGS 84 / UTM zone 31N",
        "epsg": np.int32(32631),
        "grid_mapping_name": "Unknown projected",
        "longitude_of_prime_meridian": 0.0,
        "semi_major_axis": 6378137.0,
        "inverse_flattening": 298.257223563,
        "EPSG_code": "EPSG:32631",
        "value": "value is equal to EPSG code",
    },
    "cf": {
        "grid_mapping_name": "transverse_mercator",
        "longitude_of_central_meridian": 3.0,
        "semi_major_axis": 6378137.0,
        "latitude_of_projection_origin": 0.0,
        "scale_factor_at_central_meridian": 0.9996,
        "false_easting": 500000.0,
        "false_northing": 0.0,
        "inverse_flattening": 298.257223563,
    },
    "spatial_ref": {"spatial_ref": pyproj.CRS.from_epsg(32631).to_wkt("WKT1_GDAL"), "GeoTransform": "1 2 3 4 5 6"},
    "crs_wkt": {"crs_wkt": pyproj.CRS.from_epsg(32631).to_wkt(), "grid_mapping_name": "transverse_mercator"},
    "proj4": {"proj4_params": "+proj=utm +zone=31 +datum=WGS84 +units=m +no_defs"},
}


def delft3d(path, system="epsg", curved=True, named="projected_coordinate_system"):
    """Map file of Delft3D in UTM 31, on layers of sigma: x and y of a curved grid with inactive cells, or along its rows."""
    m, n = np.arange(16.0), np.arange(13.0)
    x, y = np.meshgrid(560000.0 + 300.0 * m, 5900000.0 + 250.0 * n, indexing="ij")
    if curved:
        x, y = x + 2.0 * n[None, :] ** 2, y + 40.0 * m[:, None]
    sigma = -(np.arange(8) + 0.5) / 8.0
    depth, level = 20.0 + 0.002 * (x - 560000.0), 0.3
    seconds = np.array([0.0, 1800.0])
    lon, lat = UTM(x, y, inverse=True)
    turn = along(*UTM(x - 10.0, y, inverse=True)[::-1], *UTM(x + 10.0, y, inverse=True)[::-1])
    values = {"u_x": [], "u_y": []}
    for t in seconds:
        z = -(level + sigma[:, None, None] * (level + depth))
        east, north = current(lat, lon, z, t)
        values["u_x"].append(east * np.cos(turn) + north * np.sin(turn))
        values["u_y"].append(north * np.cos(turn) - east * np.sin(turn))
    hole = np.zeros(x.shape, bool)
    if curved:
        hole[-3:, :4] = True
    dims = ("m", "n") if curved else ("x", "y")
    with Writer(path, "NETCDF4_CLASSIC", Conventions="CF-1.6", source="Delft3D trim file") as made:
        mapping = {"grid_mapping": named}
        made.add(
            "time",
            ("time",),
            seconds / 86400.0,
            "f8",
            standard_name="time",
            units="days since 2012-03-01 00:00:00 +00:00",
            axis="T",
        )
        made.add(named, (), 32631, "i4", **SYSTEMS[system])
        for letter, places in (("x", x), ("y", y)):
            places = np.where(hole, np.nan, places) if curved else (places[:, 0] if letter == "x" else places[0])
            made.add(
                letter,
                dims if curved else (letter,),
                places,
                "f8",
                np.nan,
                standard_name=f"projection_{letter}_coordinate",
                units="m",
                axis=letter.upper(),
                **mapping,
            )
        made.add(
            "k", ("Layer",), np.arange(1.0, 9.0), "f4", long_name="layer index", units="1", axis="Z", positive="down"
        )
        made.add(
            "Layer",
            ("Layer",),
            sigma,
            "f8",
            standard_name="ocean_sigma_coordinate",
            positive="up",
            formula_terms="sigma: Layer eta: waterlevel depth: depth",
        )
        own = {"coordinates": "x y"} if curved else {}
        made.add(
            "depth",
            dims,
            np.where(hole, np.nan, depth),
            "f8",
            np.nan,
            units="m",
            positive="down",
            standard_name="sea_floor_depth_below_geoid",
            **own,
            **mapping,
        )
        made.add(
            "waterlevel",
            ("time", *dims),
            np.where(hole, np.nan, np.full((2, *x.shape), level)),
            "f8",
            np.nan,
            units="m",
            standard_name="sea_surface_elevation",
            **own,
            **mapping,
        )
        for name, word in (("u_x", "sea_water_x_velocity"), ("u_y", "sea_water_y_velocity")):
            made.add(
                name,
                ("time", "Layer", *dims),
                np.where(hole, np.nan, values[name]),
                "f8",
                np.nan,
                units="m/s",
                standard_name=word,
                **own,
                **mapping,
            )


IBCAO = pyproj.Proj(proj="stere", lat_0=90, lat_ts=75, lon_0=0, ellps="WGS84")


def elevation(x, y):
    """Elevation [m] at x and y of the polar projection of IBCAO: bilinear in both."""
    return -500.0 - 1e-3 * x + 2e-3 * (y + 1.2e6) + 1e-8 * x * (y + 1.2e6)


def ibcao(path, mapping="polar_stereographic", descending=False, **attributes):
    """Elevations on a polar stereographic grid, as the chart of the Arctic Ocean has them."""
    x, y = 500.0 * np.arange(-60, 61), -1200000.0 + 500.0 * np.arange(-50, 51)
    y = y[::-1] if descending else y
    known = {
        "grid_mapping_name": "polar_stereographic",
        "latitude_of_projection_origin": 90.0,
        "standard_parallel": 75.0,
        "straight_vertical_longitude_from_pole": 0.0,
        "false_easting": 0.0,
        "false_northing": 0.0,
        "semi_major_axis": 6378137.0,
        "inverse_flattening": 298.257223563,
    }
    with Writer(path, "NETCDF4", Conventions="CF-1.7") as made:
        if mapping:
            made.add(mapping, (), b"", "S1", **(attributes or known))
        for letter, values in (("x", x), ("y", y)):
            made.add(
                letter,
                (letter,),
                values,
                "f8",
                long_name=letter,
                units="meters",
                standard_name=f"projection_{letter}_coordinate",
            )
        made.add(
            "z",
            ("y", "x"),
            elevation(*np.meshgrid(x, y)),
            "f4",
            np.nan,
            units="meters, positive up",
            long_name="z",
            **({"grid_mapping": mapping} if mapping else {}),
        )


LAT, LON = 70.0 + 0.25 * np.arange(25.0), 20.0 + 0.5 * np.arange(30.0)


def regular(
    path,
    names,
    dims,
    units,
    time,
    latitude=LAT,
    longitude=LON,
    depth=None,
    seconds=(0.0, 86400.0),
    holes=None,
    places=None,
    standard=("eastward_sea_water_velocity", "northward_sea_water_velocity"),
    size=1.0,
    kind="f8",
    depth_units="meters",
    **words,
):
    """Velocities on latitudes and longitudes; dims: in the order of the file, whose names are t, z, y and x."""
    t, z, y, x = (words.get(letter, letter) for letter in "tzyx")
    values = {t: np.asarray(seconds), z: np.zeros(1) if depth is None else depth, y: latitude, x: longitude}
    grid = dict(zip(dims, np.meshgrid(*(values[d] for d in dims), indexing="ij"), strict=True))
    places = places or {y: y, x: x}
    with Writer(path, "NETCDF4") as made:
        number = {"seconds": 1.0, "day": 86400.0}[time["units"].split()[0].replace("days", "day")]
        made.add(
            t,
            (t,),
            time.get("first", 0.0) + np.asarray(seconds) / number,
            "f8",
            **{k: v for k, v in time.items() if k != "first"},
        )
        if depth is not None:
            made.add(
                z,
                (z,),
                depth,
                "f4",
                units=depth_units,
                positive="down",
                **{"cartesian_axis": "Z", "long_name": "tcell zstar depth"},
            )
        made.add(places[y], (y,), latitude, "f8", long_name="latitude", units="degrees_north")
        made.add(places[x], (x,), longitude, "f8", long_name="longitude", units="degrees_east")
        for name, word, part in zip(names, standard, current(grid[y], grid[x], grid.get(z, 0.0), grid[t]), strict=True):
            part = np.where(False if holes is None else holes, np.nan, part)
            made.add(name, dims, part / size, kind, -999.0, units=units, **({"standard_name": word} if word else {}))


def oscar(path):
    """Currents of OSCAR, version 2: the julian calendar, columns before rows."""
    regular(
        path,
        ("u", "v"),
        ("time", "longitude", "latitude"),
        "m s-1",
        y="latitude",
        x="longitude",
        t="time",
        places={"latitude": "lat", "longitude": "lon"},
        longitude=LON,
        time={"units": "days since 1990-1-1", "calendar": "julian", "first": 11000.0, "long_name": "time"},
    )


def access(path, calendar="NOLEAP"):
    """Means of ACCESS-OM2: velocities along the grid, a calendar without leap days, before and after the last of February."""
    regular(
        path,
        ("u", "v"),
        ("time", "st_ocean", "yu_ocean", "xu_ocean"),
        "m/sec",
        t="time",
        z="st_ocean",
        y="yu_ocean",
        x="xu_ocean",
        longitude=LON - 360.0,
        depth=np.array([1.25, 4.0, 10.0, 30.0]),
        seconds=(0.0, 86400.0, 172800.0),
        standard=("sea_water_x_velocity", "sea_water_y_velocity"),
        time={
            "units": "days since 0001-01-01 00:00:00",
            "calendar": calendar,
            "calendar_type": calendar,
            "first": 365.0 * 1999 + 57.0,
            "cartesian_axis": "T",
        },
    )


def radar(path, outage=(3,), hours=7):
    """Totals of HF radars: centimeters, columns without a value, holes that change, and times without any."""
    holes = np.zeros((hours, len(LAT), len(LON)), bool)
    holes[:, :, :3] = holes[:, 5:7, 10] = True
    holes[2, 15:20, 18:22] = True
    holes[list(outage)] = True
    regular(
        path,
        ("u", "v"),
        ("time", "lat", "lon"),
        "centimeter/s",
        t="time",
        y="lat",
        x="lon",
        latitude=LAT[::-1],
        longitude=LON + 360.0,
        seconds=3600.0 * np.arange(hours),
        holes=holes,
        size=0.01,
        kind="f4",
        standard=("surface_eastward_sea_water_velocity", "surface_northward_sea_water_velocity"),
        time={"units": "seconds since 1970-01-01", "calendar": "gregorian", "first": 1.6e9, "standard_name": "time"},
    )
    with netCDF4.Dataset(path, "r+") as file:
        dop = file.createVariable("DOPx", "i2", ("time", "lat", "lon"))
        dop.setncatts(
            {"scale_factor": "one hundredth", "units": "1", "long_name": "longitudinal dilution of precision"}
        )


def gmt(path):
    """A grid of GMT: degrees without a direction, along x and y."""
    with Writer(path, "NETCDF4", Conventions="CF-1.7", title="", GMT_version="6.4.0") as made:
        made.add("x", ("x",), LON, "f8", long_name="x", units="degrees", actual_range=LON[[0, -1]])
        made.add("y", ("y",), LAT, "f8", long_name="y", units="degrees", actual_range=LAT[[0, -1]])
        depth = -100.0 - 3.0 * (LAT[:, None] - 70.0) + 2.0 * (LON[None, :] - 20.0)
        made.add("z", ("y", "x"), depth, "f4", np.nan, long_name="z", units="meters, positive up")
