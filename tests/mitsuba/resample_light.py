"""Brings a latitude-longitude picture to 32 x 64 by exact area on the sphere.

    resample_light.py IN.hdr OUT.exr [--height 32] [--mean M]

The result has twice as many columns as rows. The energy through every cell is kept; --mean M scales the map to mean
luminance M over the sphere.
"""
import argparse

import numpy as np

import exchange_scene as ex


def overlaps(fine, coarse):
    """Share of every coarse interval in every fine one: rows sum to the width of a fine interval."""
    low = np.maximum(fine[:-1, None], coarse[None, :-1])
    high = np.minimum(fine[1:, None], coarse[None, 1:])
    return np.maximum(high - low, 0.0)


def means(fine, height):
    """The map with `height` rows that keeps the energy through every cell, and the mean radiance over the sphere."""
    rows, columns, width = *fine.shape[:2], 2 * height
    # Heights on the sphere are even in area when counted by -cos(theta).
    edges = lambda count: -np.cos(np.pi * np.arange(count + 1) / count)
    down = overlaps(edges(rows), edges(height))
    across = overlaps(np.linspace(0, 1, columns + 1), np.linspace(0, 1, width + 1))
    energy = np.einsum("rh,rcx,cw->hwx", down, fine, across, optimize=True)
    areas = down.sum(0)[:, None] * across.sum(0)[None, :]
    light = energy / areas[..., None]
    return light, (light * areas[..., None]).sum((0, 1)) / 2.0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source")
    parser.add_argument("target")
    parser.add_argument("--height", type=int, default=32, help="rows of the result")
    parser.add_argument("--mean", type=float, help="mean luminance of the result; that of the source when not given")
    options = parser.parse_args()
    ex.start("scalar_rgb")
    fine = ex.read_exr(options.source)[..., :3].astype(np.float64)
    light, mean = means(fine, options.height)
    if options.mean is not None:
        factor = options.mean / (mean @ [0.2126, 0.7152, 0.0722])
        light, mean = factor * light, factor * mean
    ex.write_exr(options.target, light)
    print(f"{options.target}: mean {mean.round(4)}, largest {light.max():.1f}")


if __name__ == "__main__":
    main()
