#!/usr/bin/env python3
"""PointNet, PointNet++ (MSG), KP-FCNN and WaffleIron in plain PyTorch: the reference of `segmentation::points`.

    python3 lab/peers/point_networks.py write shared/segmentation/tests/data/points
    cargo build --release -p studies --example bench_points
    python3 lab/peers/point_networks.py time
    cargo build --release -p studies --example bench_point_model
    python3 lab/peers/point_networks.py submap ../shared/data/annieway [POINTS]

`write` makes the reference files of the test `networks_with_torch_weights_equal_torch`: a small network, a batch, outputs in evaluation
and in training, gradients, and running statistics, computed in f64. `time` prints CPU us per point of both, one thread each.
`submap` accumulates real sweeps to a submap of 2 million points and segments it with both: cells, spheres, neighbors, network, votes. There,
PyTorch's side searches with scipy's cKDTree. `write` and `time` need torch and numpy, nothing else; `submap` also scipy and pillow. The modules are written from the publications, with the names of the published code; neighbors are
searched by brute force in f32, which `time` does not time. Debian's torch uses the BLAS of libblas.so.3: give it a fast one, e.g.
`LD_PRELOAD=/usr/lib/x86_64-linux-gnu/openblas-pthread/libopenblas.so.0`.
"""
import json, os, struct, subprocess, sys, time
import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
RELEASE = os.path.join(os.environ.get("CARGO_TARGET_DIR", os.path.join(ROOT, "target")), "release")


# Geometry ---------------------------------------------------------------------------------------------------------------------------


def nearest(queries, support, k, radius=np.inf):
    """Numbers of the k nearest support points of each query within the radius, padded with len(support); squared distances."""
    found, squared = [], []
    for start in range(0, len(queries), 256):
        d = queries[start : start + 256, None, :] - support[None]
        d2 = (d[..., 0] * d[..., 0] + d[..., 1] * d[..., 1]) + d[..., 2] * d[..., 2]
        if d2.shape[1] > 2048:
            few = np.argpartition(d2, k - 1, axis=1)[:, :k]
            near = np.take_along_axis(few, np.argsort(np.take_along_axis(d2, few, 1), axis=1, kind="stable"), 1)
        else:
            near = np.argsort(d2, axis=1, kind="stable")[:, :k]
        d2 = np.take_along_axis(d2, near, 1)
        found.append(np.where(d2 <= np.float32(radius) * np.float32(radius), near, len(support)))
        squared.append(d2)
    return np.concatenate(found), np.concatenate(squared)


def joined_search(clouds, search):
    """Joins the results of a search in each cloud: numbers shift, padding becomes the total number of support points."""
    total, start, parts = sum(len(support) for _, support in clouds), 0, []
    for queries, support in clouds:
        found, squared = search(queries, support)
        parts.append((np.where(found == len(support), total, found + start), squared))
        start += len(support)
    width = max(found.shape[1] for found, _ in parts)
    found = np.concatenate([np.pad(f, ((0, 0), (0, width - f.shape[1])), constant_values=total) for f, _ in parts])
    return torch.from_numpy(found), np.concatenate([s for _, s in parts]) if all(len(s[0]) == width for _, s in parts) else None


def barycenters(cloud, cell):
    """The barycenter of each occupied voxel, in the order of their first points."""
    voxels = {}
    for i, voxel in enumerate(map(tuple, np.floor(cloud.astype(np.float64) / np.float64(np.float32(cell))))):
        voxels.setdefault(voxel, []).append(i)
    return np.stack([cloud[members].astype(np.float64).sum(0) / len(members) for members in voxels.values()]).astype(np.float32)


def first_of_seed(seed):
    """The first number of SplitMix64."""
    z = (seed + 0x9E3779B97F4A7C15) % 2**64
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB % 2**64
    return z ^ (z >> 31)


def morton_order(cloud):
    low = cloud.min(0).astype(np.float64)
    per_m = float(2**21 - 1) / (cloud.max(0).astype(np.float64) - low).max()
    cells = ((cloud.astype(np.float64) - low) * per_m).astype(np.uint64)
    code = lambda c: sum(((int(c[a]) >> bit) & 1) << (3 * bit + a) for bit in range(21) for a in range(3))
    return sorted(range(len(cloud)), key=lambda i: (code(cells[i]), i))


def farthest(cloud, n, seed):
    """Farthest point sampling; the first point is random by the seed."""
    chosen = [morton_order(cloud)[first_of_seed(seed) % len(cloud)]]
    squared = np.full(len(cloud), np.inf, np.float32)
    while len(chosen) < min(n, len(cloud)):
        d = cloud - cloud[chosen[-1]]
        squared = np.minimum(squared, (d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1]) + d[:, 2] * d[:, 2])
        squared[chosen] = -1
        chosen.append(int(np.argmax(squared)))
    return np.array(chosen)


def gather(rows, index):
    """Rows by number; the number one past the last gives zeros."""
    return torch.cat([rows, torch.zeros_like(rows[:1])])[index]


# PointNet ---------------------------------------------------------------------------------------------------------------------------


class Transform(nn.Module):
    def __init__(self, inputs, side, w):
        super().__init__()
        self.conv1, self.conv2, self.conv3 = nn.Conv1d(inputs, w, 1), nn.Conv1d(w, 2 * w, 1), nn.Conv1d(2 * w, 16 * w, 1)
        self.fc1, self.fc2, self.fc3 = nn.Linear(16 * w, 8 * w), nn.Linear(8 * w, 4 * w), nn.Linear(4 * w, side * side)
        self.bn1, self.bn2, self.bn3 = nn.BatchNorm1d(w), nn.BatchNorm1d(2 * w), nn.BatchNorm1d(16 * w)
        self.bn4, self.bn5 = nn.BatchNorm1d(8 * w), nn.BatchNorm1d(4 * w)
        self.side = side

    def forward(self, x):
        x = F.relu(self.bn3(self.conv3(F.relu(self.bn2(self.conv2(F.relu(self.bn1(self.conv1(x)))))))))
        x = x.max(2)[0]
        x = self.fc3(F.relu(self.bn5(self.fc2(F.relu(self.bn4(self.fc1(x)))))))
        return x.view(-1, self.side, self.side) + torch.eye(self.side, dtype=x.dtype)


class Encoder(nn.Module):
    def __init__(self, inputs, w):
        super().__init__()
        self.stn, self.fstn = Transform(3 + inputs, 3, w), Transform(w, w, w)
        self.conv1, self.conv2, self.conv3 = nn.Conv1d(3 + inputs, w, 1), nn.Conv1d(w, 2 * w, 1), nn.Conv1d(2 * w, 16 * w, 1)
        self.bn1, self.bn2, self.bn3 = nn.BatchNorm1d(w), nn.BatchNorm1d(2 * w), nn.BatchNorm1d(16 * w)

    def forward(self, x):
        positions = torch.bmm(x[:, :3].transpose(1, 2), self.stn(x)).transpose(1, 2)
        x = F.relu(self.bn1(self.conv1(torch.cat([positions, x[:, 3:]], 1))))
        transform = self.fstn(x)
        local = torch.bmm(x.transpose(1, 2), transform).transpose(1, 2)
        x = self.bn3(self.conv3(F.relu(self.bn2(self.conv2(local)))))
        x = x.max(2, keepdim=True)[0].expand(-1, -1, local.shape[2])
        return torch.cat([x, local], 1), transform


class PointNet(nn.Module):
    """Clouds of one size."""

    def __init__(self, inputs, outputs, width):
        super().__init__()
        w = width
        self.feat = Encoder(inputs, w)
        self.conv1, self.conv2 = nn.Conv1d(17 * w, 8 * w, 1), nn.Conv1d(8 * w, 4 * w, 1)
        self.conv3, self.conv4 = nn.Conv1d(4 * w, 2 * w, 1), nn.Conv1d(2 * w, outputs, 1)
        self.bn1, self.bn2, self.bn3 = nn.BatchNorm1d(8 * w), nn.BatchNorm1d(4 * w), nn.BatchNorm1d(2 * w)

    def plan(self, clouds, seed):
        return clouds

    def forward(self, features, clouds):
        x = torch.cat([torch.from_numpy(np.concatenate(clouds)).to(features), features], 1)
        x, transform = self.feat(x.view(len(clouds), -1, x.shape[1]).transpose(1, 2))
        x = F.relu(self.bn3(self.conv3(F.relu(self.bn2(self.conv2(F.relu(self.bn1(self.conv1(x)))))))))
        difference = torch.bmm(transform, transform.transpose(1, 2)) - torch.eye(transform.shape[1], dtype=x.dtype)
        self.regularization = torch.norm(difference, dim=(1, 2)).mean()
        return self.conv4(x).transpose(1, 2).reshape(len(features), -1)


# PointNet++ -------------------------------------------------------------------------------------------------------------------------


class SetAbstraction(nn.Module):
    def __init__(self, inputs, centers, scales):
        super().__init__()
        self.centers, self.scales = centers, scales
        self.conv_blocks, self.bn_blocks = nn.ModuleList(), nn.ModuleList()
        for scale in scales:
            widths = [inputs + 3, *scale["widths"]]
            self.conv_blocks.append(nn.ModuleList(nn.Conv2d(a, b, 1) for a, b in zip(widths, widths[1:])))
            self.bn_blocks.append(nn.ModuleList(nn.BatchNorm2d(b) for b in widths[1:]))

    def forward(self, x, level):
        out = []
        for (index, offsets), convs, norms in zip(level["groups"], self.conv_blocks, self.bn_blocks):
            y = torch.cat([x[index], offsets.to(x)], 2).permute(2, 1, 0)[None]
            for conv, norm in zip(convs, norms):
                y = F.relu(norm(conv(y)))
            out.append(y.max(2)[0][0].t())
        return torch.cat(out, 1)


class FeaturePropagation(nn.Module):
    def __init__(self, inputs, widths):
        super().__init__()
        widths = [inputs, *widths]
        self.mlp_convs = nn.ModuleList(nn.Conv1d(a, b, 1) for a, b in zip(widths, widths[1:]))
        self.mlp_bns = nn.ModuleList(nn.BatchNorm1d(b) for b in widths[1:])

    def forward(self, skip, x, level):
        index, squared = level["nearest"]
        weights = 1 / (torch.from_numpy(squared).to(x) + 1e-8)
        x = (x[index] * (weights / weights.sum(1, keepdim=True))[..., None]).sum(1)
        x = x if skip is None else torch.cat([skip, x], 1)
        x = x.t()[None]
        for conv, norm in zip(self.mlp_convs, self.mlp_bns):
            x = F.relu(norm(conv(x)))
        return x[0].t()


class PointNet2(nn.Module):
    def __init__(self, inputs, outputs, abstractions, propagations, dropout):
        super().__init__()
        self.abstractions, channels = abstractions, [inputs]
        for level, a in enumerate(abstractions):
            self.add_module(f"sa{level + 1}", SetAbstraction(channels[-1], a["centers"], a["scales"]))
            channels.append(sum(scale["widths"][-1] for scale in a["scales"]))
        x = channels[-1]
        for level in reversed(range(len(abstractions))):
            self.add_module(f"fp{level + 1}", FeaturePropagation(x + (channels[level] if level else 0), propagations[level]))
            x = propagations[level][-1]
        self.conv1, self.bn1, self.drop1, self.conv2 = nn.Conv1d(x, x, 1), nn.BatchNorm1d(x), nn.Dropout(dropout), nn.Conv1d(x, outputs, 1)

    def plan(self, clouds, seed):
        levels = []
        for a in self.abstractions:
            centers = [cloud[farthest(cloud, a["centers"], seed)] for cloud in clouds]
            points, groups = np.concatenate(clouds), []
            for scale in a["scales"]:
                search = lambda queries, support: nearest(queries, support, scale["neighbors"], scale["radius_m"])
                index, _ = joined_search(list(zip(centers, clouds)), search)
                index = F.pad(index, (0, scale["neighbors"] - index.shape[1]), value=len(points))
                index = torch.where(index == len(points), index[:, :1], index)
                groups.append((index, torch.from_numpy(points[index.numpy()] - np.concatenate(centers)[:, None])))
            near = joined_search(list(zip(clouds, centers)), lambda queries, support: nearest(queries, support, 3))
            levels.append({"groups": groups, "nearest": near})
            clouds = centers
        return levels

    def forward(self, features, levels):
        skips, x = [], features
        for i, level in enumerate(levels):
            skips.append(x)
            x = getattr(self, f"sa{i + 1}")(x, level)
        for i, level in reversed(list(enumerate(levels))):
            x = getattr(self, f"fp{i + 1}")(skips[i] if i else None, x, level)
        return self.conv2(self.drop1(F.relu(self.bn1(self.conv1(x.t()[None])))))[0].t()


# KPConv -----------------------------------------------------------------------------------------------------------------------------


class KPConv(nn.Module):
    def __init__(self, points, inputs, outputs, radius, extent):
        super().__init__()
        self.weights = nn.Parameter(torch.empty(points, inputs, outputs).uniform_(-1, 1) / (points * inputs) ** 0.5)
        # Any placement serves the comparison; `kernel_points.rs` has the placement of the publication.
        kernel = torch.randn(points, 3)
        kernel = 0.66 * radius * kernel / kernel.norm(dim=1, keepdim=True)
        kernel[0] = 0
        self.kernel_points = nn.Parameter(kernel, requires_grad=False)
        self.extent = extent

    def forward(self, q, s, index, x):
        s = torch.cat([s, torch.zeros_like(s[:1]) + 1e6])
        offsets = (s[index] - q[:, None])[:, :, None] - self.kernel_points
        influences = torch.clamp(1 - torch.sqrt((offsets**2).sum(3)) / self.extent, min=0).transpose(1, 2)
        collected = torch.matmul(influences, gather(x, index))
        return torch.matmul(collected.permute(1, 0, 2), self.weights).sum(0)


class Norm(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.batch_norm = nn.BatchNorm1d(channels, momentum=0.1)

    def forward(self, x):
        return self.batch_norm(x)


class Bias(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.bias = nn.Parameter(torch.randn(channels) * 0.1)

    def forward(self, x):
        return x + self.bias


class Unary(nn.Module):
    def __init__(self, inputs, outputs, norm=Norm, relu=True):
        super().__init__()
        self.mlp, self.batch_norm, self.relu = nn.Linear(inputs, outputs, bias=False), norm(outputs), relu

    def forward(self, x):
        x = self.batch_norm(self.mlp(x))
        return F.leaky_relu(x, 0.1) if self.relu else x


class Simple(nn.Module):
    def __init__(self, k, inputs, outputs, radius, extent):
        super().__init__()
        self.KPConv, self.batch_norm = KPConv(k, inputs, outputs, radius, extent), Norm(outputs)

    def forward(self, x, level):
        return F.leaky_relu(self.batch_norm(self.KPConv(level["points"], level["points"], level["own"], x)), 0.1)


class Bottleneck(nn.Module):
    def __init__(self, k, inputs, outputs, radius, extent, strided):
        super().__init__()
        middle = outputs // 4
        self.unary1 = Unary(inputs, middle) if inputs != middle else nn.Identity()
        self.KPConv, self.batch_norm_conv = KPConv(k, middle, middle, radius, extent), Norm(middle)
        self.unary2 = Unary(middle, outputs, relu=False)
        self.unary_shortcut = Unary(inputs, outputs, relu=False) if inputs != outputs else nn.Identity()
        self.strided = strided

    def forward(self, features, level):
        q, index = (level["coarse"], level["pool"]) if self.strided else (level["points"], level["own"])
        x = F.leaky_relu(self.batch_norm_conv(self.KPConv(q, level["points"], index, self.unary1(features))), 0.1)
        shortcut = gather(features, index).max(1)[0] if self.strided else features
        return F.leaky_relu(self.unary2(x) + self.unary_shortcut(shortcut), 0.1)


class KPFCNN(nn.Module):
    def __init__(self, inputs, outputs, width, levels, blocks, kernel_points, cell_m, neighbors):
        super().__init__()
        self.cell_m, self.neighbors, self.levels = cell_m, neighbors, levels
        size = lambda level: (2.5 * cell_m * 2**level, 1.2 * cell_m * 2**level)
        self.encoder_blocks = nn.ModuleList([Simple(kernel_points, inputs, width // 2, *size(0))])
        self.level_of, x = [0], width // 2
        for level in range(levels):
            n = max(blocks, 2) - 1 if level == 0 else blocks
            for block in range(n + (level + 1 < levels)):
                self.encoder_blocks.append(Bottleneck(kernel_points, x, width << level, *size(level), block == n))
                self.level_of.append(level)
                x = width << level
        self.decoder_blocks = nn.ModuleList()
        for level in reversed(range(levels - 1)):
            self.decoder_blocks += [nn.Identity(), Unary(3 * (width << level), width << level)]
        self.head_mlp, self.head_softmax = Unary(width, width, Bias), Unary(width, outputs, Bias, relu=False)

    def plan(self, clouds, seed):
        levels = []
        for level in range(self.levels):
            cell = np.float32(self.cell_m) * np.float32(2**level)
            near = lambda queries, support: nearest(queries, support, self.neighbors, np.float32(2.5) * cell)
            pad = lambda index, n: F.pad(index, (0, self.neighbors - index.shape[1]), value=n)
            n = sum(map(len, clouds))
            of = {"points": torch.from_numpy(np.concatenate(clouds)), "own": pad(joined_search(list(zip(clouds, clouds)), near)[0], n)}
            if level + 1 < self.levels:
                coarse = [barycenters(cloud, 2 * cell) for cloud in clouds]
                of["coarse"] = torch.from_numpy(np.concatenate(coarse))
                of["pool"] = pad(joined_search(list(zip(coarse, clouds)), near)[0], n)
                of["up"] = joined_search(list(zip(clouds, coarse)), lambda q, s: nearest(q, s, 1))[0][:, 0]
                clouds = coarse
            levels.append(of)
        return levels

    def forward(self, x, levels):
        levels = [{k: v.to(x.dtype) if v.is_floating_point() else v for k, v in level.items()} for level in levels]
        skips = []
        for block, level in zip(self.encoder_blocks, self.level_of):
            if getattr(block, "strided", False):
                skips.append(x)
            x = block(x, levels[level])
        for i, level in enumerate(reversed(range(self.levels - 1))):
            x = self.decoder_blocks[2 * i + 1](torch.cat([x[levels[level]["up"]], skips.pop()], 1))
        return self.head_softmax(self.head_mlp(x))


# WaffleIron -------------------------------------------------------------------------------------------------------------------------


class Embedding(nn.Module):
    def __init__(self, inputs, w):
        super().__init__()
        self.norm, self.conv1 = nn.BatchNorm1d(inputs), nn.Conv1d(inputs, w, 1)
        self.conv2 = nn.Sequential(
            nn.BatchNorm2d(inputs), nn.Conv2d(inputs, w, 1, bias=False), nn.BatchNorm2d(w), nn.ReLU(), nn.Conv2d(w, w, 1, bias=False)
        )
        self.final = nn.Conv1d(2 * w, w, 1)

    def forward(self, x, neighbors):
        x = self.norm(x)
        y = self.conv2(x[:, :, neighbors] - x[..., None]).max(-1)[0]
        return self.final(torch.cat([self.conv1(x), y], 1))


class Mix(nn.Module):
    def __init__(self, w, name, layers):
        super().__init__()
        self.norm, self.scale = nn.BatchNorm1d(w), nn.Conv1d(w, w, 1, bias=False, groups=w)
        nn.init.uniform_(self.scale.weight, 0.3, 0.7)
        self.add_module(name, layers)


class SpatialMix(Mix):
    def __init__(self, w, dense):
        conv = lambda: nn.Conv2d(w, w, 3, padding=1, groups=1 if dense else w)
        super().__init__(w, "ffn", nn.Sequential(conv(), nn.ReLU(), conv()))

    def forward(self, x, plane):
        cells, clouds, height, width = plane
        n = clouds * height * width
        count = torch.zeros(n, dtype=x.dtype).index_add_(0, cells, torch.ones(len(cells), dtype=x.dtype))
        y = torch.zeros(n, x.shape[1], dtype=x.dtype).index_add(0, cells, self.norm(x)[0].t()) / count.clamp(min=1)[:, None]
        y = self.ffn(y.view(clouds, height, width, -1).permute(0, 3, 1, 2)).permute(0, 2, 3, 1).reshape(n, -1)
        return x + self.scale(y[cells].t()[None])


class ChannelMix(Mix):
    def __init__(self, w):
        super().__init__(w, "mlp", nn.Sequential(nn.Conv1d(w, w, 1), nn.ReLU(), nn.Conv1d(w, w, 1)))

    def forward(self, x):
        return x + self.scale(self.mlp(self.norm(x)))


class Backbone(nn.Module):
    def __init__(self, w, depth, dense):
        super().__init__()
        self.spatial_mix = nn.ModuleList(SpatialMix(w, dense) for _ in range(depth))
        self.channel_mix = nn.ModuleList(ChannelMix(w) for _ in range(depth))

    def forward(self, x, planes):
        for i, (spatial, channel) in enumerate(zip(self.spatial_mix, self.channel_mix)):
            x = channel(spatial(x, planes[i % 3]))
        return x


class WaffleIron(nn.Module):
    def __init__(self, inputs, outputs, width, depth, neighbors, cell_m, low_m, high_m, convolution):
        super().__init__()
        self.k, self.cell, self.low, self.high = neighbors, np.float32(cell_m), np.float32(low_m), np.float32(high_m)
        self.embed, self.waffleiron = Embedding(inputs, width), Backbone(width, depth, convolution == "dense")
        self.classif = nn.Conv1d(width, outputs, 1)

    def plan(self, clouds, seed):
        near, _ = joined_search([(c, c) for c in clouds], lambda q, s: nearest(q, s, self.k + 1))
        n_cells = np.ceil((self.high - self.low) / self.cell).astype(int)
        cell = np.clip(np.floor((np.concatenate(clouds) - self.low) / self.cell).astype(int), 0, n_cells - 1)
        cloud, planes = np.repeat(np.arange(len(clouds)), [len(c) for c in clouds]), []
        for a, b in [(0, 1), (0, 2), (1, 2)]:
            index = (cloud * n_cells[a] + cell[:, a]) * n_cells[b] + cell[:, b]
            planes.append((torch.from_numpy(index), len(clouds), int(n_cells[a]), int(n_cells[b])))
        return near[:, 1:], planes

    def forward(self, features, plan):
        x = self.embed(features.t()[None], plan[0])
        return self.classif(self.waffleiron(x, plan[1]))[0].t()


# Reference files --------------------------------------------------------------------------------------------------------------------

KINDS = {"pointnet": PointNet, "pointnet2": PointNet2, "kpconv": KPFCNN, "waffle_iron": WaffleIron}
WAFFLE = dict(inputs=4, outputs=3, width=12, depth=4, neighbors=5, cell_m=0.4, low_m=[-1.5, -1.5, -0.5], high_m=[1.5, 1.3, 1.0])
SMALL = {
    "pointnet": ("pointnet", dict(inputs=4, outputs=5, width=4)),
    "pointnet2": (
        "pointnet2",
        dict(
            inputs=4,
            outputs=5,
            abstractions=[
                {"centers": 60, "scales": [{"radius_m": 0.4, "neighbors": 8, "widths": [8, 12]}, {"radius_m": 0.8, "neighbors": 12, "widths": [8, 16]}]},
                {"centers": 16, "scales": [{"radius_m": 0.9, "neighbors": 6, "widths": [16, 20]}, {"radius_m": 1.6, "neighbors": 8, "widths": [16, 24]}]},
            ],
            propagations=[[16, 16], [32, 20]],
            dropout=0.0,
        ),
    ),
    "kpconv": ("kpconv", dict(inputs=4, outputs=5, width=12, levels=3, blocks=2, kernel_points=15, cell_m=0.15, neighbors=14)),
    "waffle_iron": ("waffle_iron", dict(WAFFLE, convolution="depth_wise")),
    "waffle_iron_dense": ("waffle_iron", dict(WAFFLE, depth=2, width=6, convolution="dense")),
}
SEED = 7


def street(n, seed):
    """Points of a road, a wall and a pole in a box of about 3 m."""
    r = np.random.default_rng(seed)
    road = np.stack([r.uniform(-1.5, 1.5, n), r.uniform(-1.5, 1.5, n), 0.02 * r.normal(size=n)], 1)
    wall = np.stack([r.uniform(-1.5, 1.5, n), 1.3 + 0.02 * r.normal(size=n), r.uniform(0, 1.2, n)], 1)
    pole = np.stack([0.3 + 0.05 * r.normal(size=n), 0.1 + 0.05 * r.normal(size=n), r.uniform(0, 1.2, n)], 1)
    return np.concatenate([road, wall, pole])[r.permutation(3 * n)[:n]].astype(np.float32)


def write_safetensors(path, tensors, metadata):
    header, data = {"__metadata__": metadata}, b""
    for name, tensor in tensors.items():
        numbers = np.ascontiguousarray(tensor.detach().numpy().astype("<f4")).tobytes()
        header[name] = {"dtype": "F32", "shape": list(tensor.shape), "data_offsets": [len(data), len(data) + len(numbers)]}
        data += numbers
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + data)


def write(folder):
    for name, (kind, sizes) in SMALL.items():
        torch.manual_seed(3)
        network = KINDS[kind](**sizes)
        # Statistics and scales that differ from 0 and 1. f32 values, so that both sides have the same numbers.
        for key, tensor in network.state_dict().items():
            if key.endswith("running_mean"):
                tensor.copy_(0.1 * torch.randn_like(tensor))
            elif key.endswith("running_var"):
                tensor.copy_(0.5 + torch.rand_like(tensor))
            elif tensor.dim() == 1 and key.endswith("weight"):
                tensor.copy_(0.7 + 0.6 * torch.rand_like(tensor))
        network = network.double()
        # PointNet's fully connected layers normalize over the clouds of a batch: a few, of one size.
        clouds = [street(n, i) for i, n in enumerate([48] * 6 if kind == "pointnet" else [130, 90])]
        features = torch.randn(sum(map(len, clouds)), sizes["inputs"]).double().requires_grad_()
        weights = torch.randn(len(features), sizes["outputs"])
        # The file has the values from before the training pass.
        tensors = {key: t.clone() for key, t in network.state_dict().items() if not key.endswith("tracked")}
        plan = network.plan(clouds, SEED)
        tensors.update({"test.positions": torch.from_numpy(np.concatenate(clouds)), "test.features": features.clone()})
        tensors.update({"test.lengths": torch.tensor([len(c) for c in clouds]), "test.loss_weights": weights})
        for mode in ["evaluation", "training"]:
            network.train(mode == "training")
            network.zero_grad()
            features.grad = None
            scores = network(features, plan)
            loss = (scores * weights).mean()
            if hasattr(network, "regularization"):
                loss = loss + 0.1 * network.regularization
                tensors[f"test.{mode}.regularization"] = network.regularization.reshape(1)
            loss.backward()
            tensors[f"test.{mode}.scores"] = scores
            tensors[f"test.{mode}.gradient.features"] = features.grad.clone()
            for key, parameter in network.named_parameters():
                # Gradients of evaluation differ only by the normalization: some suffice.
                if parameter.grad is not None and (mode == "training" or "1." in key or "embed" in key):
                    tensors[f"test.{mode}.gradient.{key}"] = parameter.grad.clone()
        for key, tensor in network.state_dict().items():
            if "running" in key:
                tensors[f"test.statistics.{key}"] = tensor
        path = os.path.join(folder, f"{name}.safetensors")
        write_safetensors(path, tensors, {"model": json.dumps({"architecture": "points", "version": 1, "settings": {"kind": kind, **sizes}})})
        print(path, os.path.getsize(path))


# Times ------------------------------------------------------------------------------------------------------------------------------

MSG = [
    (1024, [(0.5, 16, [16, 16, 32]), (1.0, 32, [32, 32, 64])]),
    (256, [(1.0, 16, [64, 64, 128]), (2.0, 32, [64, 96, 128])]),
    (64, [(2.0, 16, [128, 196, 256]), (4.0, 32, [128, 196, 256])]),
    (16, [(4.0, 16, [256, 256, 512]), (8.0, 32, [256, 384, 512])]),
]
LARGE = {
    "pointnet": ("pointnet", dict(inputs=4, outputs=10, width=64)),
    "pointnet2": (
        "pointnet2",
        dict(
            inputs=4,
            outputs=10,
            abstractions=[
                {"centers": n, "scales": [{"radius_m": r, "neighbors": k, "widths": w} for r, k, w in scales]} for n, scales in MSG
            ],
            propagations=[[128, 128, 128], [256, 128], [256, 256], [256, 256]],
            dropout=0.5,
        ),
    ),
    "kpconv": ("kpconv", dict(inputs=4, outputs=10, width=64, levels=5, blocks=2, kernel_points=15, cell_m=0.2, neighbors=32)),
    "waffle_iron": (
        "waffle_iron",
        dict(inputs=4, outputs=10, width=64, depth=12, neighbors=16, cell_m=0.4, low_m=[-10, -10, -2], high_m=[10, 10, 8], convolution="depth_wise"),
    ),
}


def fastest_us(n, run):
    run()
    times = []
    for _ in range(n):
        begin = time.process_time()
        run()
        times.append(time.process_time() - begin)
    return 1e6 * min(times)


def measure():
    import tempfile

    torch.set_num_threads(1)
    print("us per point         plan |  forward  torch  ratio | forward and backward  torch  ratio")
    for name, (kind, sizes) in LARGE.items():
        torch.manual_seed(3)
        network = KINDS[kind](**sizes)
        # Two spheres of 10 m of a street, subsampled as KPConv asks.
        clouds = []
        for i in range(2):
            cloud = street(60000, i) * np.float32([6, 6, 5])
            clouds.append(barycenters(cloud[(cloud**2).sum(1) < 100], 0.2)[:4096])
        features = torch.randn(sum(map(len, clouds)), sizes["inputs"])
        plan = network.plan(clouds, SEED)
        tensors = {key: t for key, t in network.state_dict().items() if not key.endswith("tracked")}
        tensors.update({"test.positions": torch.from_numpy(np.concatenate(clouds)), "test.features": features})
        tensors["test.lengths"] = torch.tensor([len(c) for c in clouds])
        with tempfile.NamedTemporaryFile(prefix=name, suffix=".safetensors", delete="--keep" not in sys.argv) as file:
            card = {"architecture": "points", "version": 1, "settings": {"kind": kind, **sizes}}
            write_safetensors(file.name, tensors, {"model": json.dumps(card)})
            program = os.path.join(RELEASE, "examples", "bench_points")
            environment = {k: v for k, v in os.environ.items() if k != "LD_PRELOAD"}
            environment["RAYON_NUM_THREADS"] = "1"
            ours = subprocess.run([program, file.name], env=environment, check=True, capture_output=True, text=True).stdout
        plan_us, forward, both = map(float, ours.split()[1:])
        n = len(features)
        network.eval()
        with torch.no_grad():
            torch_forward = fastest_us(5, lambda: network(features, plan)) / n
        network.train()
        torch_both = fastest_us(3, lambda: (network(features, plan) ** 2).mean().backward()) / n
        print(
            f"{name:12s} {n:6d} {plan_us:6.2f} | {forward:8.2f} {torch_forward:6.2f} {torch_forward / forward:6.2f} |"
            f" {both:20.2f} {torch_both:6.2f} {torch_both / both:6.2f}",
            flush=True,
        )
    # One convolution as in `bench_points` without a file.
    points = street(60000, 1)[:8192] * np.float32([4, 4, 3])
    index = torch.from_numpy(nearest(points, points, 32)[0])
    points = torch.from_numpy(points)
    radius = float((points[index[:, -1]] - points).norm(dim=1).mean())
    layer, x = KPConv(15, 64, 64, radius, 0.48 * radius), torch.randn(8192, 64)
    with torch.no_grad():
        forward = fastest_us(5, lambda: layer(points, points, index, x)) / 8192
    x.requires_grad_()
    both = fastest_us(3, lambda: layer(points, points, index, x).sum().backward()) / 8192
    print(f"KPConv 64 -> 64 of torch: forward {forward:.2f}, forward and backward {both:.2f} us/point")


# A large submap ------------------------------------------------------------------------------------------------------------------------


def sweeps_of(folder, wanted):
    """Points of the drive durlacher by its INS poses, in m around the first one, and origin and end of each sweep."""
    from PIL import Image

    numbers = [line for line in open(f"{folder}/range_image.cfg") if not line.startswith("#")][-1].split()
    per_metre, width, height = float(numbers[0]), int(numbers[1]), int(numbers[2])
    up = -np.radians(np.array(numbers[5 : 5 + height], float))[:, None]
    azimuth = np.radians(180 - 360 * (np.arange(width) + 0.5) / width)[None]
    rays = np.stack([np.cos(up) * np.cos(azimuth), np.cos(up) * np.sin(azimuth), np.sin(up) + 0 * azimuth], -1)
    rows = [line.split(";") for line in open(f"{folder}/durlacher/ins.csv") if line.startswith("20")]
    points, origins, ends = [], [], []
    for i, row in enumerate(rows):
        if sum(map(len, points)) >= wanted:
            break
        turn = float(row[5])
        origin = np.array([float(v) for v in row[14:17]])
        image = np.array(Image.open(f"{folder}/durlacher/scan{i:05d}.png")).astype(float) / per_metre
        valid = (image > 1.5) & (image < 120)
        x, y, z = (rays * image[..., None])[valid].T
        here = np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z], 1) + origin
        points.append(here)
        origins.append(origin)
        ends.append(sum(map(len, points)))
    points = np.concatenate(points)[:wanted] - origins[0]
    return points.astype(np.float32), np.float32(origins - origins[0]), np.minimum(ends, wanted)


def segmented(network, k, points, settings):
    """The classes of all points with PyTorch and cKDTree, as `PointModel` does it, without heights. Seconds by part."""
    from scipy.spatial import cKDTree

    seconds, last = {}, [time.perf_counter()]

    def part(name):
        now = time.perf_counter()
        seconds[name] = seconds.get(name, 0) + now - last[0]
        last[0] = now

    _, cell, counts = np.unique(np.floor(points / settings["cell_m"]).astype(np.int32), axis=0, return_inverse=True, return_counts=True)
    cells = np.stack([np.bincount(cell, points[:, axis]) / counts for axis in range(3)], 1).astype(np.float32)
    part("cells")
    radius, overlap = settings["spheres"]["radius_m"], settings["spheres"]["overlap_m"]
    spacing, tree = 2 * radius - overlap, cKDTree(cells)
    # The center of each occupied cell of the grid; later single cells that no sphere contains.
    centers, open_cells = (np.unique(np.floor(cells / spacing), axis=0) + 0.5) * spacing, None
    votes, covered, n_spheres, n_seen = np.zeros((len(cells), len(settings["classes"])), np.float32), np.zeros(len(cells), bool), 0, 0
    while len(centers):
        for i, center in enumerate(centers):
            if open_cells is not None and covered[open_cells[i]]:
                continue
            members = np.array(tree.query_ball_point(center, radius))
            covered[members.astype(int)] = True
            if len(members) < 2:
                continue
            cloud = (cells[members] - center).astype(np.float32)
            part("spheres")
            near = cKDTree(cloud).query(cloud, min(k + 1, len(cloud)))[1][:, 1:]
            part("neighbors")
            n_cells = np.ceil((network.high - network.low) / network.cell).astype(int)
            at, planes = np.clip(np.floor((cloud - network.low) / network.cell).astype(int), 0, n_cells - 1), []
            for a, b in [(0, 1), (0, 2), (1, 2)]:
                planes.append((torch.from_numpy(at[:, a] * n_cells[b] + at[:, b]), 1, int(n_cells[a]), int(n_cells[b])))
            features = np.concatenate([cloud, np.zeros((len(cloud), 4), np.float32)], 1)
            scores = network(torch.from_numpy(features), (torch.from_numpy(near), planes))
            part("network")
            votes[members] += torch.softmax(scores, 1).numpy()
            n_spheres, n_seen = n_spheres + 1, n_seen + len(members)
            part("votes")
        left = np.flatnonzero(~covered)
        open_cells = left[np.sort(np.unique(np.floor(cells[left] / radius), axis=0, return_index=True)[1])]
        centers = cells[open_cells]
    classes = votes.argmax(1)[cell]
    part("votes")
    return classes, seconds, (len(cells), n_spheres, n_seen)


def measure_submap(folder, wanted=2_000_000):
    import resource, tempfile

    torch.set_num_threads(2)
    torch.manual_seed(3)
    points, origins, ends = sweeps_of(folder, wanted)
    classes = ["building", "fence", "pedestrian", "pole", "road-line", "road", "sidewalk", "vegetation", "vehicles", "wall"]
    sizes = dict(inputs=7, outputs=len(classes), width=48, depth=9, neighbors=12, cell_m=0.6, low_m=[-12] * 3, high_m=[12] * 3, convolution="depth_wise")
    settings = {"network": {"kind": "waffle_iron", **sizes}, "classes": classes, "features": ["offset", "height", "intensity"], "cell_m": 0.2}
    settings.update(spheres={"radius_m": 12.0, "overlap_m": 4.0}, temperature=1.0)
    network = WaffleIron(**sizes).eval()
    with tempfile.TemporaryDirectory() as temporary:
        tensors = {key: t for key, t in network.state_dict().items() if not key.endswith("tracked")}
        card = {"model": json.dumps({"architecture": "points", "version": 1, "settings": settings})}
        write_safetensors(f"{temporary}/model.safetensors", tensors, card)
        submap = {"points": torch.from_numpy(points), "origins": torch.from_numpy(origins), "ends": torch.tensor(ends).float()}
        write_safetensors(f"{temporary}/submap.safetensors", submap, {})
        program = os.path.join(RELEASE, "examples", "bench_point_model")
        environment = {k: v for k, v in os.environ.items() if k != "LD_PRELOAD"}
        subprocess.run([program, f"{temporary}/model.safetensors", f"{temporary}/submap.safetensors"], env=environment, check=True)
    begin, begin_cpu = time.perf_counter(), time.process_time()
    with torch.no_grad():
        _, seconds, (n_cells, n_spheres, n_seen) = segmented(network, sizes["neighbors"], points, settings)
    wall, cpu = time.perf_counter() - begin, time.process_time() - begin_cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1.024e-3
    print(f"{len(points)} points, {n_cells} cells, {n_spheres} spheres with {n_seen} cells")
    print(f"torch and cKDTree: {wall:.2f} s, {cpu:.2f} CPU s: {len(points) / wall:.0f} points/s, {len(points) / cpu:.0f} points per CPU second; peak {peak:.0f} MB")
    print("seconds", {name: round(value, 2) for name, value in seconds.items()})


if __name__ == "__main__":
    if sys.argv[1:2] == ["write"]:
        write(sys.argv[2])
    elif sys.argv[1:2] == ["time"]:
        measure()
    elif sys.argv[1:2] == ["submap"]:
        measure_submap(sys.argv[2], *map(int, sys.argv[3:4]))
    else:
        sys.exit(__doc__)
