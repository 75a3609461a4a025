"""Trains shaped weights of the neural reflectance with PyTorch and writes them as the program reads them.

    python train_shaped.py LIBRARY COMPACT.safetensors -o SHAPED.safetensors [--leave-out NAME ...] [--seconds 420]
        [--take-up SHAPED.pt]

LIBRARY is the folder of the neural fits, COMPACT.safetensors weights of `patina-lab measured train` to begin from: their
layers and codes are kept, a shape of 102 numbers a material and the gates of every layer are learned with them. Materials
that COMPACT has not seen begin near the middle of the ball. A sitting ends with its rates at nothing; `--take-up` begins
another one, with rates up again, where it ended, and may know more materials. Beside the output `.pt` holds what that needs.

What is made small is the mean over materials of the log-RMSE that `patina-lab measured codes` tells (not its square: each
material's mean square counts by one over its running root), on cells of the table drawn anew for every step. Beside the
measured materials there are made-up ones that keep the weights general: mixes of two, their channels exchanged, their
brightness changed, their lobes drawn wider or narrower, some with a constant taken off.
"""
import argparse
import json
import math
import os
import sys
import time

import numpy
import torch
from safetensors import safe_open
from safetensors.torch import save_file

OWN, SHAPE, FLOOR = 16, 102, 1e-8
# Conditioners: features, outputs of their layers, bins of the spline, whether it is periodic.
NETS = [(8, [128, 128, 128, 65], 32, False), (4, [64, 64, 49], 24, False), (0, [32, 24], 12, True)]
CHANNEL_SCALE = torch.tensor([1.0, 1.15, 1.66]) / 1500
LARGEST_EXPONENT = 80.0
# Lengths that codes and shapes may have before they are brought to the unit ball: room for materials to come, whose fits
# lie further out than those that were trained on.
BALLS = 1.9, 2.5


class Fits:
    """The neural fits of measured materials."""

    def __init__(self, folder):
        self.names = open(os.path.join(folder, "merl_dev88_names.txt")).read().split()
        path = os.path.join(folder, "merl_dev88_weights_f32le.bin")
        raw = torch.from_numpy(numpy.fromfile(path, "<f4").copy()).reshape(len(self.names), 675)
        sizes = [(6, 21), (1, 21), (21, 21), (1, 21), (21, 3), (1, 3)]
        parts = raw.split([a * b for a, b in sizes], 1)
        self.parts = [part.reshape(-1, a, b).contiguous() for part, (a, b) in zip(parts, sizes)]

    def stored(self, index, half, difference, azimuth, less=None):
        """Stored values [M, P, 3] of materials at angles [M, P]; `less` is taken off before the ramp at the end."""
        sine = difference.sin()
        x = [half.sin(), torch.zeros_like(half), half.cos(), sine * azimuth.cos(), sine * azimuth.sin(), difference.cos()]
        w1, b1, w2, b2, w3, b3 = (part[index] for part in self.parts)
        a = torch.relu(torch.baddbmm(b1, torch.stack(x, -1), w1))
        a = torch.baddbmm(b3, torch.relu(torch.baddbmm(b2, a, w2)), w3)
        return torch.relu(torch.expm1(a if less is None else a - less[:, None, None])) / CHANNEL_SCALE


def horizon(difference, azimuth):
    return torch.atan2(difference.cos().clamp(min=0), difference.sin() * azimuth.cos().abs()).clamp(max=math.pi / 2)


class Cells:
    """The cells of a table above the horizon, column by column of theta_half."""

    def __init__(self):
        j, k = torch.meshgrid(torch.arange(90), torch.arange(180), indexing="ij")
        difference, azimuth = j.reshape(-1).double() / 90 * math.pi / 2, k.reshape(-1).double() / 180 * math.pi
        edge, half = horizon(difference, azimuth), (torch.arange(90).double() / 90) ** 2 * math.pi / 2
        self.count = (half[None] < edge[:, None] - 1e-9).sum(1)
        self.until = self.count.cumsum(0)
        self.difference, self.azimuth, self.edge, self.half = (x.float() for x in (difference, azimuth, edge, half))

    def draw(self, materials, columns, cells, random):
        """Columns [M, C], in proportion to their cells, and angles of cells evenly over each [M, C, P]."""
        total = int(self.until[-1])
        place = (torch.arange(columns)[None] + torch.rand(materials, columns, generator=random)) / columns * total
        column = torch.searchsorted(self.until, place.long().clamp(max=total - 1), right=True)
        count = self.count[column].float()[..., None]
        part = (torch.arange(cells)[None, None] + torch.rand(materials, columns, 1, generator=random)) / cells
        return column, self.half[torch.minimum((part * count).long(), (count - 1).long())]


def log_density(raw, bins, x, periodic):
    """Logarithm of the piecewise linear density of each row of raw numbers at each of its x."""
    raw = raw.clamp(-20, 20)
    width = torch.softmax(raw[:, :bins], 1) * (1 - bins * 1e-4) + 1e-4
    height = torch.exp(raw[:, bins:] - raw[:, bins:].amax(1, keepdim=True).detach())
    if periodic:
        height = torch.cat([height, height[:, :1]], 1)
    area = (0.5 * (height[:, 1:] + height[:, :-1]) * width).sum(1, keepdim=True)
    height = FLOOR + (1 - FLOOR) * height / area
    end = torch.cumsum(width, 1)
    index = torch.searchsorted(end[:, :-1].detach().contiguous(), x.contiguous(), right=True)
    own, low, high = width.gather(1, index), height.gather(1, index), height.gather(1, index + 1)
    return torch.log(low + (high - low) * ((x - end.gather(1, index) + own) / own).clamp(0, 1))


class Flow(torch.nn.Module):
    """The compact flow with gates. Per layer: w matrix, b bias, s shift by code, g gate by code."""

    def __init__(self, weights):
        super().__init__()
        torch.manual_seed(1)
        self.p, at = torch.nn.ParameterDict(), 0

        def take(*shape):
            nonlocal at
            at += math.prod(shape)
            return weights[at - math.prod(shape) : at].reshape(shape).clone()

        for net, (features, layers, _, _) in enumerate(NETS):
            before = features
            for layer, width in enumerate(layers):
                matrix = take(before, width) if before else None
                shift = take(OWN, width) if layer == 0 else torch.zeros(OWN, width)
                of_shape = 0.3 * torch.randn(SHAPE, width) / math.sqrt(max(before, 8))
                own = {"b": take(width), "s": torch.cat([shift, of_shape])}
                if before:
                    own |= {"w": matrix, "g": torch.cat([torch.zeros(OWN, width), 0.075 * torch.randn(SHAPE, width)])}
                for name, value in own.items():
                    self.p[f"{name}{net}{layer}"] = torch.nn.Parameter(value)
                before = width
        assert at == len(weights), "these are not compact weights"

    def net(self, net, x, code, columns):
        for layer, width in enumerate(NETS[net][1]):
            pre = self.p[f"b{net}{layer}"] + code @ self.p[f"s{net}{layer}"]
            if x is not None:
                gate = 1 + code @ self.p[f"g{net}{layer}"]
                product = (x @ self.p[f"w{net}{layer}"]).view(-1, columns, width)
                pre = torch.addcmul(pre[:, None], product, gate[:, None]).reshape(-1, width)
            x = pre if layer + 1 == len(NETS[net][1]) else 0.5 * (pre + torch.sqrt(pre * pre + 0.25))
        return x

    def forward(self, code, difference, azimuth, u):
        """Log density [G, C, P] of codes [G, L] in columns at angles [G, C], u of theta_half in the cube [G, C, P]."""
        groups, columns = difference.shape
        d, a, turn = difference / (math.pi / 2), azimuth / math.pi, 2 * math.pi
        waves_d = torch.stack([2 * d - 1, (turn * d).cos(), (2 * turn * d).cos(), d**16], -1)
        waves_a = torch.stack([(turn * a).cos(), (turn * a).sin(), (2 * turn * a).cos(), (2 * turn * a).sin()], -1)
        rows = groups * columns
        raw = self.net(0, torch.cat([waves_d, waves_a], -1).view(rows, 8), code, columns)
        found = log_density(raw, *NETS[0][2:3], u.reshape(rows, -1), False).view(groups, columns, -1)
        raw = self.net(1, waves_a.reshape(rows, 4), code, columns)
        found = found + log_density(raw, NETS[1][2], d.reshape(-1, 1), False).view(groups, columns, 1)
        raw = self.net(2, None, code, 1)
        return found + log_density(raw, NETS[2][2], a, True).view(groups, columns, 1)

    def packed(self, scale):
        """All weights in the order of the program, maps of codes scaled."""
        parts = []
        for net, (_, layers, _, _) in enumerate(NETS):
            shift = lambda layer: self.p[f"s{net}{layer}"] * scale
            for layer in range(len(layers)):
                parts += [self.p[f"w{net}{layer}"]] if f"w{net}{layer}" in self.p else []
                parts += ([shift(0)] if layer == 0 else []) + [self.p[f"b{net}{layer}"]]
            for layer in range(len(layers)):
                parts += [shift(layer)] if layer else []
                parts += [self.p[f"g{net}{layer}"] * scale] if f"g{net}{layer}" in self.p else []
        return torch.cat([part.detach().reshape(-1) for part in parts])


class Table:
    """Rows of numbers, each with its own Adam."""

    def __init__(self, rows):
        self.rows, self.first, self.second, self.steps = rows, 0 * rows, 0 * rows, torch.zeros(len(rows))

    def step(self, index, slope, rate):
        self.steps[index] += 1
        steps = self.steps[index].view(-1, *[1] * (slope.dim() - 1))
        self.first[index] = 0.9 * self.first[index] + 0.1 * slope
        self.second[index] = 0.99 * self.second[index] + 0.01 * slope**2
        spread = (self.second[index] / (1 - 0.99**steps)).sqrt() + 1e-8
        self.rows[index] -= rate * self.first[index] / (1 - 0.9**steps) / spread


class MadeUp:
    """Materials that are none: what each is made of."""

    def __init__(self, count, known, random):
        normal = lambda *shape: torch.randn(count, *shape, generator=random)
        chance = lambda: torch.rand(count, generator=random)
        self.pair = known[torch.randint(0, len(known), (count, 2), generator=random)]
        self.share = chance() * (chance() < 0.7)
        self.warp, self.warp_difference = torch.exp(0.3 * normal(2)), torch.exp(0.1 * normal(2))
        self.gain = torch.exp(0.3 * normal(2, 1) + 0.3 * normal(2, 3))
        deal = lambda: torch.randperm(3, generator=random)
        self.channel = torch.stack([torch.stack([deal(), deal()]) for _ in range(count)])
        self.less = torch.exp(math.log(1e-4) + math.log(300) * chance()) * (chance() < 0.3)

    def stored(self, fits, k, half, difference, azimuth):
        total, last, right = 0, 89 / 90 * math.pi / 2, math.pi / 2
        share = (half / horizon(difference, azimuth)).clamp(0, 1)
        for part in range(2):
            moved = (right * (difference / right) ** self.warp_difference[k, part, None]).clamp(max=last)
            high = horizon(moved, azimuth) * share ** self.warp[k, part, None]
            value = fits.stored(self.pair[k, part], high, moved, azimuth, self.less[k])
            value = value.gather(2, self.channel[k, part][:, None].expand(-1, value.shape[1], 3))
            weight = self.share[k] if part else 1 - self.share[k]
            total = total + weight[:, None, None] * value * self.gain[k, part][:, None]
        return total


def differences(flow, cells, shape, own, colour, column, half, stored):
    """Differences of logarithms of stored values [M, 3, C, P], and which cells count."""
    count, columns, points = half.shape
    u = (half / cells.edge[column][..., None]).clamp(0, 1).sqrt()
    code = torch.cat([own, shape[:, None].expand(-1, 3, -1)], -1).reshape(3 * count, -1)
    thrice = lambda x: x.repeat_interleave(3, 0)
    found = flow(code, thrice(cells.difference[column]), thrice(cells.azimuth[column]), thrice(u))
    exponent = (found.view(count, 3, columns, points) + colour[:, :, None, None]).clamp(max=math.log(LARGEST_EXPONENT)).exp()
    logarithm = torch.where(exponent > 20, exponent, torch.log(torch.expm1(exponent.clamp(max=20)) + 1e-6))
    return logarithm - torch.log(stored.permute(0, 3, 1, 2) + 1e-6), (stored[..., 0] > 0).float()[:, None]


def mean(values, counts):
    return (values * counts).sum((1, 2, 3)) / (3 * counts.sum((1, 2, 3))).clamp(min=1)


def main():
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("library")
    ask.add_argument("compact")
    ask.add_argument("-o", "--output", required=True)
    ask.add_argument("--leave-out", nargs="*", default=[])
    ask.add_argument("--only-known", action="store_true", help="only materials that COMPACT was trained on")
    ask.add_argument("--seconds", type=float, default=420, help="of processor time")
    ask.add_argument("--take-up")
    ask.add_argument("--rate", type=float, default=2e-3)
    ask.add_argument("--made-up", type=int, default=240)
    ask.add_argument("--per-step", type=int, nargs=2, default=[30, 14], help="measured and made-up materials")
    asked = ask.parse_args()
    torch.set_num_threads(1)
    random = torch.Generator().manual_seed(7)
    fits, cells = Fits(asked.library), Cells()
    compact = safe_open(asked.compact, "pt")
    account = json.loads(compact.metadata()["patina"])
    known = account["materials"]
    allowed = known if asked.only_known else fits.names
    names = [name for name in fits.names if name in allowed and name not in asked.leave_out]
    index = torch.tensor([fits.names.index(name) for name in names])
    count, made = len(names), MadeUp(asked.made_up, index, random)
    flow = Flow(compact.get_tensor("weights"))
    start_codes = compact.get_tensor("codes").reshape(-1, 3, OWN)
    start_colours = compact.get_tensor("log_colours").reshape(-1, 3)
    total = count + asked.made_up
    own = 0.01 * torch.randn(total, 3, OWN, generator=random)
    colour = start_colours.mean(0).repeat(total, 1)
    for row in range(total):
        of = index[row] if row < count else made.pair[row - count, 0]
        deal = torch.arange(3) if row < count else made.channel[row - count, 0]
        if fits.names[of] in known:
            place = known.index(fits.names[of])
            own[row], colour[row] = start_codes[place][deal], start_colours[place][deal]
    shape, run = 0.02 * torch.randn(total, SHAPE, generator=random), torch.ones(total)
    steps, spent, commands = 0, 0.0, []
    if asked.take_up:
        kept = torch.load(asked.take_up, weights_only=True)
        flow.load_state_dict(kept["flow"])
        steps, spent, commands = kept["steps"], kept["seconds"], kept["commands"]
        for row, name in enumerate(names):
            if name in kept["names"]:
                place = kept["names"].index(name)
                shape[row], own[row], colour[row], run[row] = (kept[key][place] for key in ("shape", "own", "colour", "run"))
    tables = [Table(shape), Table(own), Table(colour)]
    weights = list(flow.parameters())
    adam = torch.optim.Adam(weights, betas=(0.9, 0.99))
    begin, told, first = time.process_time(), 0.0, steps
    while (share := (time.process_time() - begin) / asked.seconds) < 1:
        factor = (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * share))) * min(1, (steps - first + 1) / 200)
        measured = torch.randperm(count, generator=random)[: asked.per_step[0]]
        others = torch.randperm(asked.made_up, generator=random)[: asked.per_step[1]]
        rows = torch.cat([measured, count + others])
        column, half = cells.draw(len(rows), 16, 12, random)
        spread = lambda x: x[column][..., None].expand_as(half).reshape(len(rows), -1)
        angles = half.reshape(len(rows), -1), spread(cells.difference), spread(cells.azimuth)
        parts = len(measured)
        stored = torch.cat([
            fits.stored(index[measured], *(x[:parts] for x in angles)),
            made.stored(fits, others, *(x[parts:] for x in angles)),
        ]).view(*half.shape, 3)
        leaves = [table.rows[rows].clone().requires_grad_() for table in tables]
        off, counts = differences(flow, cells, *leaves, column, half, stored)
        run[rows] = 0.97 * run[rows] + 0.03 * mean(off.detach() ** 2, counts).clamp(max=9)
        # Large differences pull linearly: what was measured as nothing has no logarithm to reach.
        tame = torch.where(off.abs() < 2, off**2, 4 * off.abs() - 4)
        loss = (mean(tame, counts) / run[rows].sqrt().clamp(min=0.04)).mean() / 2 + 1e-4 * (leaves[0] ** 2).sum(1).mean()
        adam.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(weights, 1.0)
        adam.param_groups[0]["lr"] = asked.rate * factor
        adam.step()
        for table, leaf in zip(tables, leaves):
            table.step(rows, leaf.grad, 4e-3 * factor)
        steps += 1
        if share * asked.seconds - told > 30:
            told = share * asked.seconds
            print(f"{told:.0f} s, {steps} steps: log-RMSE {run[:count].sqrt().mean():.4f}, made up {run[count:].sqrt().mean():.4f}", flush=True)
    spent += asked.seconds
    left_out = asked.leave_out or (account["left_out"] if asked.only_known else [])
    commands.append("python tests/neural/train_shaped.py " + " ".join(map(os.path.basename, sys.argv[1:])))
    shape, own, colour = shape[:count], own[:count], colour[:count]
    kept = {"flow": flow.state_dict(), "names": names, "shape": shape, "own": own, "colour": colour, "run": run[:count]}
    torch.save(kept | {"steps": steps, "seconds": spent, "commands": commands}, os.path.splitext(asked.output)[0] + ".pt")
    # The program keeps codes in the unit ball: lengths go into the maps that see them.
    lengths = [torch.maximum(found * (1 + 1e-6), torch.tensor(ball)) for found, ball in zip((own.norm(dim=2).max(), shape.norm(dim=1).max()), BALLS)]
    scale = torch.cat([lengths[0].expand(OWN), lengths[1].expand(SHAPE)])[:, None]
    account["architecture"] |= {"name": "shaped", "code": OWN + SHAPE, "shape": SHAPE, "gates": True, "floor_digits": 8}
    account["settings"] |= {"log_error_weight": 1.0, "steps": steps, "rate": asked.rate, "code_rate": 4e-3}
    account |= {"materials": names, "left_out": left_out, "command": "; ".join(commands), "step": steps, "seconds": spent}
    # Likelihood is not what was learned, and is not told.
    account |= {"log_likelihood": 0.0, "divergence": 0.0, "log_error": float(run[:count].sqrt().mean())}
    tensors = {"weights": flow.packed(scale), "codes": (own / lengths[0]).reshape(-1, OWN), "shapes": shape / lengths[1]}
    tensors["log_colours"] = colour.reshape(-1)
    save_file({name: value.contiguous() for name, value in tensors.items()}, asked.output, {"patina": json.dumps(account)})


if __name__ == "__main__":
    main()
