"""Compares two folders of pictures by a z-test: the same names in both, variance of the mean in variance/NAME.exr.

A side without variance is taken to have the other's, times --missing-variance (0 for a noiseless picture, 0.25 for one
with four times the samples). A variance from K batches makes z follow Student's law: with K = 16 on both sides its
RMS is about 1.035 and 0.5 % lie above 3; with a variance from one side only 1.07 and 0.9 %. Prints one JSON line a view
and one for all; ends with 1 when a limit is passed or a value is not finite.
"""
import argparse
import json
import sys
from pathlib import Path

import numpy as np

import exchange_scene as ex


def variance_beside(folder, name):
    path = Path(folder) / "variance" / f"{name}.exr"
    return ex.read_exr(path)[..., :3].astype(np.float64) if path.exists() else None


def figures(ours, theirs, variance):
    """z over pixels and channels that carry noise; relative RMSE against the mean square of theirs."""
    difference = ours - theirs
    # A pixel without noise on either side (background, black) has no z: it must agree to rounding instead.
    noisy = variance > 1e-14 + (1e-5 * np.abs(theirs)) ** 2
    z = difference[noisy] / np.sqrt(variance[noisy])
    z = z if z.size else np.zeros(1)
    square = np.mean(theirs**2)
    return {
        "z_max": float(np.abs(z).max()), "z_mean": float(z.mean()), "z_rms": float(np.sqrt((z**2).mean())),
        "z_above_3": float((np.abs(z) > 3).mean()),
        "mean_over_its_error": float(difference[noisy].sum() / np.sqrt(variance[noisy].sum() + 1e-300)),
        "relative_rmse": float(np.sqrt(np.mean(difference**2) / square)),
        "relative_rmse_expected": float(np.sqrt(np.mean(variance) / square)),
        "relative_mean": float(difference.mean() / np.mean(theirs)),
        "noiseless_max": float(np.abs(difference[~noisy]).max() if (~noisy).any() else 0.0),
        "noisy_values": int(noisy.sum()),
        "non_finite": int((~np.isfinite(difference + variance)).sum()),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("ours")
    parser.add_argument("theirs")
    parser.add_argument("--missing-variance", type=float, default=0.0)
    parser.add_argument("--limit-above-3", type=float, default=0.01, help="share of |z| > 3; 0.0027 for a normal law")
    parser.add_argument("--limit-rms", type=float, default=1.15)
    parser.add_argument("--block", type=int, default=1, help="average blocks of this many pixels a side first: finds "
                        "biases below a pixel's noise")
    options = parser.parse_args()
    ex.start("scalar_rgb")
    names = sorted(path.stem for path in Path(options.ours).glob("*.exr"))
    names = [name for name in names if (Path(options.theirs) / f"{name}.exr").exists()]
    if not names:
        sys.exit("the folders have no picture of the same name")
    everything = []
    for name in names:
        ours, theirs = (ex.read_exr(Path(f) / f"{name}.exr")[..., :3].astype(np.float64)
                        for f in (options.ours, options.theirs))
        v, w = variance_beside(options.ours, name), variance_beside(options.theirs, name)
        if v is None and w is None:
            sys.exit(f"{name}: no variance on either side")
        v, w = (options.missing_variance * w if v is None else v), (options.missing_variance * v if w is None else w)
        block = options.block
        if block > 1:
            rows, columns = (size // block * block for size in ours.shape[:2])
            fold = lambda a: a[:rows, :columns].reshape(rows // block, block, columns // block, block, 3).mean((1, 3))
            ours, theirs, v, w = fold(ours), fold(theirs), fold(v) / block**2, fold(w) / block**2
        everything.append((ours.ravel(), theirs.ravel(), (v + w).ravel()))
        print(json.dumps({"view": name} | figures(*everything[-1])))
    total = figures(*(np.concatenate(part) for part in zip(*everything)))
    print(json.dumps({"view": "all", "views": len(names)} | total))
    # Values that are not finite are asked for by themselves: a comparison with one is false.
    if total["non_finite"] or total["z_above_3"] > options.limit_above_3 or total["z_rms"] > options.limit_rms:
        sys.exit(1)


main()
