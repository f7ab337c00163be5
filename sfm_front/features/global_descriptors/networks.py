"""The three networks behind the global vectors, as torch modules.

Parameter names and layer order are torchvision's, so that its weights files load as they are.
``forward`` maps a batch (B, 3, H, W) float32, normalised by ImageNet's mean and standard deviation,
to descriptors (B, D) float32 of any norm. H and W are free. Each network's classifier (its
``HEAD``) is part of the module, so that a complete file loads, but is never run.

Sources: Krizhevsky, "One weird trick for parallelizing convolutional neural networks", 2014
(AlexNet); He et al., "Deep residual learning for image recognition", CVPR 2016 (ResNet101);
Sandler et al., "MobileNetV2: inverted residuals and linear bottlenecks", CVPR 2018.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import torch
from torch import Tensor, nn

NUM_CLASSES = 1000


class DescriptorNetwork(nn.Module):
    """A network that describes photos: ``forward`` maps (B, 3, H, W) to (B, DIMENSION)."""

    DIMENSION: ClassVar[int]
    HEAD: ClassVar[str]
    """Prefix of the parameters that the descriptor does not need."""


class AlexNet(DescriptorNetwork):
    """AlexNet up to FC7, the second fully connected layer, after its ReLU (4096 numbers).

    After the ReLU, because Caffe applies it in place and "FC7" has come to mean the result.
    """

    DIMENSION = 4096
    HEAD = "classifier.6."

    def __init__(self) -> None:
        super().__init__()
        self.features = nn.Sequential(
            nn.Conv2d(3, 64, kernel_size=11, stride=4, padding=2),
            nn.ReLU(inplace=True),
            nn.MaxPool2d(kernel_size=3, stride=2),
            nn.Conv2d(64, 192, kernel_size=5, padding=2),
            nn.ReLU(inplace=True),
            nn.MaxPool2d(kernel_size=3, stride=2),
            nn.Conv2d(192, 384, kernel_size=3, padding=1),
            nn.ReLU(inplace=True),
            nn.Conv2d(384, 256, kernel_size=3, padding=1),
            nn.ReLU(inplace=True),
            nn.Conv2d(256, 256, kernel_size=3, padding=1),
            nn.ReLU(inplace=True),
            nn.MaxPool2d(kernel_size=3, stride=2),
        )
        self.avgpool = nn.AdaptiveAvgPool2d((6, 6))
        self.classifier = nn.Sequential(
            nn.Dropout(),
            nn.Linear(256 * 6 * 6, 4096),
            nn.ReLU(inplace=True),
            nn.Dropout(),
            nn.Linear(4096, 4096),
            nn.ReLU(inplace=True),
            nn.Linear(4096, NUM_CLASSES),
        )

    def forward(self, batch: Tensor) -> Tensor:
        """(B, 3, H, W) to (B, 4096), not negative. H and W of 63 or more."""
        pooled = self.avgpool(self.features(batch)).flatten(1)
        fc7: Tensor = self.classifier[:-1](pooled)
        return fc7


class Bottleneck(nn.Module):
    """ResNet's block: 1x1 narrows, 3x3 works, 1x1 widens fourfold, and the input is added."""

    EXPANSION = 4

    def __init__(self, channels_in: int, channels: int, stride: int) -> None:
        super().__init__()
        channels_out = channels * self.EXPANSION
        self.conv1 = nn.Conv2d(channels_in, channels, kernel_size=1, bias=False)
        self.bn1 = nn.BatchNorm2d(channels)
        # Stride here, not in conv1: the weights were trained that way.
        self.conv2 = nn.Conv2d(channels, channels, 3, stride=stride, padding=1, bias=False)
        self.bn2 = nn.BatchNorm2d(channels)
        self.conv3 = nn.Conv2d(channels, channels_out, kernel_size=1, bias=False)
        self.bn3 = nn.BatchNorm2d(channels_out)
        self.relu = nn.ReLU(inplace=True)
        self.downsample: nn.Sequential | None = None
        if stride != 1 or channels_in != channels_out:
            self.downsample = nn.Sequential(
                nn.Conv2d(channels_in, channels_out, kernel_size=1, stride=stride, bias=False),
                nn.BatchNorm2d(channels_out),
            )

    def forward(self, x: Tensor) -> Tensor:
        shortcut = x if self.downsample is None else self.downsample(x)
        x = self.relu(self.bn1(self.conv1(x)))
        x = self.relu(self.bn2(self.conv2(x)))
        x = self.bn3(self.conv3(x))
        x += shortcut
        out: Tensor = self.relu(x)
        return out


class ResNet101(DescriptorNetwork):
    """ResNet101 up to pool5, the average of its last feature map (2048 numbers)."""

    DIMENSION = 2048
    HEAD = "fc."

    def __init__(self) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(3, 64, kernel_size=7, stride=2, padding=3, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        self.relu = nn.ReLU(inplace=True)
        self.maxpool = nn.MaxPool2d(kernel_size=3, stride=2, padding=1)
        self.layer1 = _bottlenecks(64, 64, count=3, stride=1)
        self.layer2 = _bottlenecks(256, 128, count=4, stride=2)
        self.layer3 = _bottlenecks(512, 256, count=23, stride=2)
        self.layer4 = _bottlenecks(1024, 512, count=3, stride=2)
        self.avgpool = nn.AdaptiveAvgPool2d(1)
        self.fc = nn.Linear(2048, NUM_CLASSES)

    def forward(self, batch: Tensor) -> Tensor:
        """(B, 3, H, W) to (B, 2048), not negative."""
        x = self.maxpool(self.relu(self.bn1(self.conv1(batch))))
        x = self.layer4(self.layer3(self.layer2(self.layer1(x))))
        pool5: Tensor = self.avgpool(x).flatten(1)
        return pool5


def _bottlenecks(channels_in: int, channels: int, *, count: int, stride: int) -> nn.Sequential:
    """``count`` blocks; the first changes resolution and width."""
    first = Bottleneck(channels_in, channels, stride)
    rest = (Bottleneck(channels * Bottleneck.EXPANSION, channels, 1) for _ in range(count - 1))
    return nn.Sequential(first, *rest)


class InvertedResidual(nn.Module):
    """MobileNetV2's block: 1x1 widens, 3x3 works per channel, 1x1 narrows without a ReLU."""

    def __init__(self, channels_in: int, channels_out: int, stride: int, expansion: int) -> None:
        super().__init__()
        hidden = channels_in * expansion
        self.adds_input = stride == 1 and channels_in == channels_out
        layers: list[nn.Module] = []
        if expansion != 1:
            layers.append(_conv_bn_relu6(channels_in, hidden, kernel_size=1))
        layers += [
            _conv_bn_relu6(hidden, hidden, kernel_size=3, stride=stride, groups=hidden),
            nn.Conv2d(hidden, channels_out, kernel_size=1, bias=False),
            nn.BatchNorm2d(channels_out),
        ]
        self.conv = nn.Sequential(*layers)

    def forward(self, x: Tensor) -> Tensor:
        out: Tensor = self.conv(x)
        return x + out if self.adds_input else out


class MobileNetV2(DescriptorNetwork):
    """MobileNetV2 up to the average of its last feature map (TUNING: network-pooling)."""

    DIMENSION = 1280
    HEAD = "classifier."

    # Table 2 of the paper: expansion, channels, blocks, stride of the first block.
    TABLE = (
        (1, 16, 1, 1),
        (6, 24, 2, 2),
        (6, 32, 3, 2),
        (6, 64, 4, 2),
        (6, 96, 3, 1),
        (6, 160, 3, 2),
        (6, 320, 1, 1),
    )

    def __init__(self) -> None:
        super().__init__()
        self.features = nn.Sequential(
            _conv_bn_relu6(3, 32, kernel_size=3, stride=2),
            *self._blocks(),
            _conv_bn_relu6(320, self.DIMENSION, kernel_size=1),
        )
        self.classifier = nn.Sequential(nn.Dropout(0.2), nn.Linear(self.DIMENSION, NUM_CLASSES))

    @classmethod
    def _blocks(cls) -> Iterator[InvertedResidual]:
        channels_in = 32
        for expansion, channels, count, first_stride in cls.TABLE:
            for stride in (first_stride, *(1,) * (count - 1)):
                yield InvertedResidual(channels_in, channels, stride, expansion)
                channels_in = channels

    def forward(self, batch: Tensor) -> Tensor:
        """(B, 3, H, W) to (B, 1280), not negative."""
        feature_map: Tensor = self.features(batch)
        return torch.mean(feature_map, dim=(2, 3))


def _conv_bn_relu6(
    channels_in: int, channels_out: int, *, kernel_size: int, stride: int = 1, groups: int = 1
) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(
            channels_in,
            channels_out,
            kernel_size,
            stride,
            padding=kernel_size // 2,
            groups=groups,
            bias=False,
        ),
        nn.BatchNorm2d(channels_out),
        nn.ReLU6(inplace=True),
    )
