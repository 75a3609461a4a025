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


def transform(x, raw):
    """Integral and log density of a piecewise-linear density at x."""
    width = torch.softmax(raw[:, :BINS], 1)
    height = torch.exp(raw[:, BINS:])
    area = ((height[:, 1:] + height[:, :-1]) * 0.5 * width).sum(1, keepdim=True)
    height = height / area
    knots = torch.cumsum(width, 1)
    index = (x[:, None] >= knots).sum(1).clamp(max=BINS - 1)[:, None]
    pick = lambda values, at: values.gather(1, at)[:, 0]
    low, high, own = pick(height, index), pick(height, index + 1), pick(width, index)
    begin = pick(knots, index) - own
    mass = torch.cumsum((height[:, 1:] + height[:, :-1]) * 0.5 * width, 1)
    before = pick(mass, index) - (low + high) * 0.5 * own
    t = ((x - begin) / own).clamp(0, 1)
    return before + own * (low * t + 0.5 * (high - low) * t * t), torch.log(low + t * (high - low))


class Flow(nn.Module):
    def __init__(self):
        super().__init__()
        self.nets = nn.ModuleList(UNet() for _ in range(6))

    def forward(self, points, codes):
        coordinates, log_density = list(points.unbind(1)), 0.0
        for index, net in enumerate(self.nets):
            axis = index % 3
            given = [coordinates[other] for other in range(3) if other != axis]
            raw = net(torch.cat([torch.stack(given, 1), codes], 1))
            coordinates[axis], own = transform(coordinates[axis], raw)
            log_density = log_density + own
        return log_density


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
        flow(points, codes).mean().backward()

    print(f"{best(evaluate):.3e} evaluations/s, {best(gradient):.3e} with gradients/s")


if __name__ == "__main__":
    main()
