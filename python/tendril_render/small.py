"""Pictures of 256 colours, chosen so that rare colours keep their shades: a rod has many on few pixels."""
import numpy as np
from PIL import Image


def nearest(colours, palette):
    """Index (n,) of the palette's colour nearest to each of the colours (n, 3)."""
    p = palette.T
    out = np.empty(len(colours), np.uint8)
    for k in range(0, len(colours), 8192):
        c = colours[k : k + 8192]
        out[k : k + 8192] = ((p**2).sum(0) - 2 * (c[:, :1] * p[0] + c[:, 1:2] * p[1] + c[:, 2:] * p[2])).argmin(1)
    return out


def few_colours(image, keep=(), rounds=12):
    """The image with a palette: k-means of its colours, each weighed by the root of how many pixels have it.

    keep: colours (n, 3) as bytes that stay as they are, such as those of a scale, n much less than 256.
    """
    pixels = np.asarray(image).reshape(-1, 3).astype(np.int64)
    code, which, count = np.unique(pixels @ [65536, 256, 1], return_inverse=True, return_counts=True)
    colours = np.stack([code >> 16, code >> 8 & 255, code & 255], 1).astype(float)
    if len(colours) <= 256:
        palette = np.pad(colours, ((0, 256 - len(colours)), (0, 0)), mode="edge")
    else:
        weight = np.sqrt(count)
        start = image.quantize(256, method=Image.Quantize.MEDIANCUT)
        palette = np.array(start.getpalette()[:768], float).reshape(-1, 3)
        palette = np.pad(palette, ((0, 256 - len(palette)), (0, 0)), mode="edge")
        for _ in range(rounds):
            k = nearest(colours, palette)
            total = np.bincount(k, weight, 256)
            for c in range(3):
                mean = np.bincount(k, weight * colours[:, c], 256) / np.maximum(total, 1e-9)
                palette[:, c] = np.where(total > 0, mean, palette[:, c])
        keep = np.concatenate([colours[count.argsort(kind="stable")[-8:]], np.reshape(keep, (-1, 3))])  # and the paper
        palette[total.argsort(kind="stable")[: len(keep)]] = keep
        palette = np.round(palette)
    small = Image.fromarray(nearest(colours, palette)[which].reshape(image.size[::-1]), mode="P")
    small.putpalette(palette.astype(np.uint8).ravel().tolist())
    return small
