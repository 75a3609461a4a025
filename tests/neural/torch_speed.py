"""The paper's flow in PyTorch on the CPU, timed as `patina measured speed` times ours: same sizes, same batch.

    python torch_speed.py [--batch 65536] [--repeats 5] [--threads N]

Six couplings of eight bins, U-Net conditioners, a code of sixteen numbers: 840,006 weights.
"""
import argparse
import time

import torch
import torch.nn as nn

BINS, CODE = 8, 16


class UNet(nn.Module):
    def __init__(self):
        super().__init__()
        sizes = [(2 + CODE, 256), (256, 128), (128, 64), (64, 32), (32, 16), (16, 32), (64, 64), (128, 128), (256, 256)]
        self.layers = nn.ModuleList(nn.Linear(*size) for size in sizes)
        self.last = nn.Linear(256, 2 * BINS + 1)

    def forward(self, x):
        outputs = []
        for index, layer in enumerate(self.layers):
            if index >= 6:
                x = torch.cat([x, outputs[9 - index]], 1)
            x = torch.relu(layer(x))
            outputs.append(x)
        return self.last(x)


def pieces(raw):
    """Knots, widths, heights at the knots and mass up to the end of each piece of a piecewise-linear density."""
    width = torch.softmax(raw[:, :BINS], 1)
    height = torch.exp(raw[:, BINS:])
    area = ((height[:, 1:] + height[:, :-1]) * 0.5 * width).sum(1, keepdim=True)
    height = height / area
    mass = torch.cumsum((height[:, 1:] + height[:, :-1]) * 0.5 * width, 1)
    return torch.cumsum(width, 1), width, height, mass


def piece_of(x, ends, knots, width, height, mass):
    """The piece that x lies in by the ends of the pieces: its begin, width, two heights and the mass before it."""
    index = (x[:, None] >= ends).sum(1).clamp(max=BINS - 1)[:, None]
    pick = lambda values, at: values.gather(1, at)[:, 0]
    low, high, own = pick(height, index), pick(height, index + 1), pick(width, index)
    return pick(knots, index) - own, own, low, high, pick(mass, index) - (low + high) * 0.5 * own


def transform(x, raw):
    """Integral and log density of a piecewise-linear density at x."""
    knots, width, height, mass = pieces(raw)
    begin, own, low, high, before = piece_of(x, knots, knots, width, height, mass)
    t = ((x - begin) / own).clamp(0, 1)
    return before + own * (low * t + 0.5 * (high - low) * t * t), torch.log(low + t * (high - low))


def inverse(y, raw):
    """The x of which the integral is y, and the log density there."""
    knots, width, height, mass = pieces(raw)
    begin, own, low, high, before = piece_of(y, mass, knots, width, height, mass)
    rest = ((y - before) / own).clamp(min=0)
    t = (2 * rest / (low + torch.sqrt((low * low + 2 * (high - low) * rest).clamp(min=0)))).clamp(0, 1)
    return begin + own * t, torch.log(low + t * (high - low))


class Flow(nn.Module):
    def __init__(self):
        super().__init__()
        self.nets = nn.ModuleList(UNet() for _ in range(6))

    def forward(self, points, codes):
        """Points carried to the uniform cube, and their log density."""
        return self.carried(points, codes, enumerate(self.nets), transform)

    def samples(self, uniform, codes):
        """Uniform numbers carried back to points of the density, and its logarithm there."""
        return self.carried(uniform, codes, reversed(list(enumerate(self.nets))), inverse)

    def carried(self, points, codes, nets, step):
        coordinates, log_density = list(points.unbind(1)), 0.0
        for index, net in nets:
            axis = index % 3
            given = [coordinates[other] for other in range(3) if other != axis]
            raw = net(torch.cat([torch.stack(given, 1), codes], 1))
            coordinates[axis], own = step(coordinates[axis], raw)
            log_density = log_density + own
        return torch.stack(coordinates, 1), log_density


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--batch", type=int, default=65536)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--threads", type=int, default=0)
    options = parser.parse_args()
    if options.threads:
        torch.set_num_threads(options.threads)
    torch.manual_seed(1)
    flow = Flow()
    print(sum(weight.numel() for weight in flow.parameters()), "weights,", torch.get_num_threads(), "threads")
    points, codes = torch.rand(options.batch, 3), 0.1 * torch.randn(options.batch, CODE)

    def best(work):
        least = float("inf")
        for _ in range(options.repeats):
            begin = time.perf_counter()
            work()
            least = min(least, time.perf_counter() - begin)
        return options.batch / least

    def evaluate():
        with torch.no_grad():
            flow(points, codes)

    def gradient():
        flow.zero_grad()
        flow(points, codes)[1].mean().backward()

    def sample():
        with torch.no_grad():
            flow.samples(points, codes)

    with torch.no_grad():
        uniform, log_density = flow(points[:1000], codes[:1000])
        back, log_density_back = flow.samples(uniform, codes[:1000])
        difference = max((back - points[:1000]).abs().max(), (log_density_back - log_density).abs().max())
        print(f"there and back again within {difference:.1e}")
    print(f"{best(evaluate):.3e} evaluations/s, {best(gradient):.3e} with gradients/s, {best(sample):.3e} samples/s")


if __name__ == "__main__":
    main()
