"""Figures between two linear pictures."""
import numpy as np


def luminance(picture):
    return picture @ np.array([0.2126, 0.7152, 0.0722])


def best_factor(picture, reference, counted):
    a, b = picture[counted], reference[counted]
    return float((a * b).sum() / max((a * a).sum(), 1e-20))


def relative_rmse(picture, reference, counted):
    """(RMSE after the best factor over the mean of the reference, that factor)."""
    factor = best_factor(picture, reference, counted)
    difference = factor * picture[counted] - reference[counted]
    return float(np.sqrt((difference**2).mean()) / reference[counted].mean()), factor


def tone_mapped(picture, white):
    scaled = np.clip(picture / white, 0.0, 1.0)
    return np.where(scaled <= 0.0031308, 12.92 * scaled, 1.055 * scaled ** (1 / 2.4) - 0.055)


def window_mean(values, side=7):
    sums = np.cumsum(np.cumsum(np.pad(values, ((1, 0), (1, 0))), 0), 1)
    return (sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]) / side**2


def ssim(picture, reference, counted):
    """Wang et al. 2004 over windows of 7 x 7 that surface covers wholly; black counts as equal elsewhere."""
    white = np.quantile(luminance(reference)[counted], 0.98)
    a, b = (luminance(tone_mapped(np.where(counted[..., None], x, 0.0), white)) for x in (picture, reference))
    mean_a, mean_b = window_mean(a), window_mean(b)
    var_a, var_b = window_mean(a * a) - mean_a**2, window_mean(b * b) - mean_b**2
    both = window_mean(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    value = (2 * mean_a * mean_b + c1) * (2 * both + c2) / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))
    return float(value[window_mean(counted.astype(float)) > 0.999].mean())


def z_scores(ours, our_variance, others, counted):
    """z of each pixel and channel from our mean and its variance and several independent pictures of another."""
    mean, variance = others.mean(0), others.var(0, ddof=1) / len(others)
    z = (mean - ours) / np.sqrt(np.maximum(our_variance + variance, 1e-12))
    z = z[counted]
    return float(z.mean()), float((z**2).mean()), float((np.abs(z) > 5).mean())
