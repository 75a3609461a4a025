"""The lobe against quadrature: its density integrates to the share of valid samples, its samples give its albedo."""
import itertools
import sys

import numpy as np

import exchange_scene as ex

CASES = [(0.5, 0.04, 0.5, 0.3), (0.2, 0.5, 0.05, 0.9), (0.0, 1.0, 0.2, 0.2), (0.5, 0.04, 0.02, 1.3),
         (0.3, 0.3, 1.0, 1.0), (0.0, 0.0, 0.1, 1.4), (0.1, 0.9, 0.005, 0.6)]


def closed_form(rho_d, f0, r, i, o):
    """The lobe times cosine in plain numpy, float64."""
    h = i + o
    h /= np.linalg.norm(h, axis=0)
    e, k = 2 / r - 2, 0.5 * np.sqrt(r)
    d = (e + 2) / (2 * np.pi) * h[2] ** e
    f = f0 + (1 - f0) * (1 - (h * o).sum(0)) ** 5
    g = [c / (c * (1 - k) + k) for c in (i[2], o[2])]
    return (rho_d / np.pi + d * f * g[0] * g[1] / (4 * i[2] * o[2])) * o[2]


def closed_form_ggx(rho_d, f0, r, i, o):
    """The same with the distribution of Trowbridge and Reitz and Smith's height-correlated masking."""
    h = i + o
    h /= np.linalg.norm(h, axis=0)
    d = r / (np.pi * (h[2] ** 2 * (r - 1) + 1) ** 2)
    f = f0 + (1 - f0) * (1 - (h * o).sum(0)) ** 5
    masked = lambda c: (np.sqrt(1 + r * (1 - c * c) / (c * c)) - 1) / 2
    return (rho_d / np.pi + d * f / (1 + masked(i[2]) + masked(o[2])) / (4 * i[2] * o[2])) * o[2]


def main():
    mi, dr = ex.start()
    context, random, worst, bad = mi.BSDFContext(), np.random.default_rng(1), 0.0, 0
    kinds = (("modct", closed_form), ("ggx", closed_form_ggx))
    for (kind, formula), (rho_d, f0, r, theta) in itertools.product(kinds, CASES):
        grey = lambda value: {"type": "uniform", "value": value}
        lobe = mi.load_dict({"type": kind, "diffuse": grey(rho_d), "specular": grey(f0), "roughness": grey(r)})
        i = np.array([np.sin(theta), 0.0, np.cos(theta)])

        def hit(count):
            si = dr.zeros(mi.SurfaceInteraction3f, count)
            si.wi, si.t, si.sh_frame, si.n = mi.Vector3f(*map(float, i)), 1.0, mi.Frame3f([0, 0, 1]), [0, 0, 1]
            return si

        rows = 2400
        z, phi = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(rows) + 0.5) / rows * 2 * np.pi, indexing="ij")
        s = np.sqrt(1 - z * z)
        o = np.stack([s * np.cos(phi), s * np.sin(phi), z]).reshape(3, -1)
        out = mi.Vector3f(*(mi.Float(x.astype(np.float32)) for x in o))
        value, density = lobe.eval_pdf(context, hit(o.shape[1]), out)
        value, density = np.array(value)[0], np.array(density)
        exact = formula(rho_d, f0, r, np.repeat(i[:, None], o.shape[1], 1), o)
        departure = np.max(np.abs(value - exact) / (exact + 1e-3 * exact.max()))
        count = 2_000_000
        sample, weight = lobe.sample(context, hit(count), mi.Float(random.random(count, np.float32)),
                                     mi.Point2f(random.random(count, np.float32), random.random(count, np.float32)))
        weight, valid = np.array(weight)[0].astype(float), np.mean(np.array(sample.pdf) > 0)
        albedo, error = exact.mean() * 2 * np.pi, weight.std() / np.sqrt(count)
        z_albedo = (weight.mean() - albedo) / (error + 1e-3 * albedo)
        mass = density.astype(float).mean() * 2 * np.pi
        good = departure < 2e-3 and abs(z_albedo) < 4 and abs(mass - valid) < 3e-3
        bad += not good
        print(f"{kind}: rho_d {rho_d} F0 {f0} r {r} theta {theta}: eval off by {departure:.1e}, "
              f"density {mass:.4f} / valid {valid:.4f}, "
              f"albedo {albedo:.5f} sampled {weight.mean():.5f} +- {error:.1e}  {'ok' if good else 'BAD'}")
    sys.exit(int(bad > 0))


main()
