"""Pictures as `patina-lab proof` reads them."""
import numpy as np


def write_pfm(path, picture):
    """Linear RGB, row 0 at the top, as a portable float map, whose rows begin at the bottom."""
    height, width, _ = picture.shape
    with open(path, "wb") as file:
        file.write(f"PF\n{width} {height}\n-1.0\n".encode())
        file.write(np.ascontiguousarray(picture[::-1], dtype="<f4").tobytes())


def write_pictures(stem, view, pictures):
    """The mean of several pictures, and the variance of that mean."""
    pictures = np.stack(pictures).astype(np.float64)
    write_pfm(f"{stem}_{view}_mean.pfm", pictures.mean(0))
    write_pfm(f"{stem}_{view}_variance.pfm", pictures.var(0, ddof=1) / len(pictures))
