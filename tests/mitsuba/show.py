"""Pictures side by side as one sRGB PNG: show.py OUT.png [--exposure E] [--columns N] A.exr B.exr ..."""
import argparse

import numpy as np

import exchange_scene as ex


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("target")
    parser.add_argument("pictures", nargs="+")
    parser.add_argument("--exposure", type=float, default=1.0)
    parser.add_argument("--columns", type=int, default=6)
    options = parser.parse_args()
    mi, _ = ex.start("scalar_rgb")
    tiles = [np.repeat(p, 3, 2) if p.shape[2] == 1 else p[..., :3] for p in map(ex.read_exr, options.pictures)]
    rows, columns = max(t.shape[0] for t in tiles), max(t.shape[1] for t in tiles)
    count = min(options.columns, len(tiles))
    sheet = np.zeros((-(-len(tiles) // count) * rows, count * columns, 3), np.float32)
    for index, tile in enumerate(tiles):
        y, x = index // count * rows, index % count * columns
        sheet[y:y + tile.shape[0], x:x + tile.shape[1]] = tile
    x = np.clip(sheet * options.exposure, 0, 1)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    with ex.replacing(options.target) as temporary:
        mi.Bitmap((encoded * 255 + 0.5).astype(np.uint8)).write(str(temporary))


main()
