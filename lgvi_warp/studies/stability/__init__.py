"""Maps of where each method is accurate, bounded or unstable, over two parameters."""
