"""What is written on a picture: the scale of colours and a line of words."""
import os

import numpy as np
from matplotlib import colormaps, get_data_path
from PIL import Image, ImageDraw, ImageFont

FONT = os.path.join(get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")


class Colours:
    """Colours of values between `lower` and `upper`; the maps are safe for the colour-blind.

    Signed values get one of two sides, the others one from dark to bright; on each paper without its own end.
    """

    def __init__(self, lower, upper, dark):
        self.lower, self.upper = lower, upper
        if lower < 0 < upper and np.isclose(-lower, upper):
            name, first, last = ("coolwarm", 0.0, 1.0)
        else:
            name, first, last = ("plasma", 0.2, 1.0) if dark else ("plasma", 0.08, 0.92)
        self.table = colormaps[name](np.linspace(first, last, 256))[:, :3]

    def of(self, v):
        """Linear colours (n, 3) of values (n,)."""
        s = np.clip((v - self.lower) / max(self.upper - self.lower, 1e-300), 0, 1) * 255
        k = np.minimum(s.astype(int), 254)
        s = (s - k)[:, None]
        t = self.table**2.2
        return t[k] * (1 - s) + t[k + 1] * s


def number(v):
    return "0" if v == 0 else f"{v:.3g}".replace("e-0", "e-").replace("e+0", "e")


def letter_size(width, height):
    return max(9, round(min(width / 62, height / 34)))


def label_places(clouds, width, height):
    """A place (x, y) for a short word beside each cloud of pixels (n, 2), far from the others.

    Words keep clear of all clouds, of each other, and of the legend below; None if there is no room.
    """
    size = letter_size(width, height)
    room = np.array([2.3, 1.1]) * size  # half sizes that a word needs
    clouds = [c[np.isfinite(c).all(1)][:: max(1, len(c) // 400)] for c in clouds]
    angle = np.arange(12) * np.pi / 6
    around = 1.05 * room * np.stack([np.cos(angle), np.sin(angle)], 1)
    places = []
    for j, own in enumerate(clouds):
        others = np.concatenate([c for k, c in enumerate(clouds) if k != j] + [np.array(places).reshape(-1, 2)])
        at = (own[:, None] + around).reshape(-1, 2)
        at = at[((at > room) & (at < [width - room[0], 0.86 * height])).all(1)]
        if not len(at) or not len(others):
            return None

        def distance(a, b, scale):
            return np.sqrt((((a[:, None] - b) / scale) ** 2).sum(-1)).min(1)
        free = (distance(at, own, room) >= 1) & (distance(at, others, room) >= 1)
        if not free.any():
            return None
        places.append(at[free][distance(at[free], others, 1).argmax()])
    return places


def write(picture, theme, words="", colours=None, title="", labels=(), clipped=False):
    """The picture (height, width, 3) as an image, with words at the left and the scale of colours at the right.

    labels: pairs of a place (x, y) and a word. clipped: some values are above the scale.
    """
    image = Image.fromarray(picture)
    h, w = picture.shape[:2]
    d = ImageDraw.Draw(image)
    size = letter_size(w, h)
    font = ImageFont.truetype(FONT, size)
    ink = tuple(int(255 * v) for v in theme.ink)
    base, edge = h - round(1.2 * size), round(1.6 * size)
    for place, word in labels:
        d.text(tuple(place), word, fill=ink, font=font, anchor="mm")
    if words:
        d.text((edge, base), words, fill=ink, font=font, anchor="ls")
    if colours is not None:
        width, height = round(0.26 * w), round(0.55 * size)
        x0, y0 = w - edge - width, base - round(1.75 * size)
        row = colours.table[np.linspace(0, 255, width).round().astype(int)]
        strip = np.broadcast_to((255 * row).astype(np.uint8), (height, width, 3))
        image.paste(Image.fromarray(np.ascontiguousarray(strip)), (x0, y0))
        d.text((x0, base), number(colours.lower), fill=ink, font=font, anchor="ls")
        upper = ("≥ " if clipped else "") + number(colours.upper)
        d.text((x0 + width, base), upper, fill=ink, font=font, anchor="rs")
        if colours.lower < 0 < colours.upper:
            d.text((x0 + width / 2, base), "0", fill=ink, font=font, anchor="ms")
        d.text((x0 + width / 2, y0 - round(0.5 * size)), title, fill=ink, font=font, anchor="ms")
    return image
