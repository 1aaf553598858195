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


def write(picture, theme, words="", colours=None, title=""):
    """The picture (height, width, 3) as an image, with words at the left and the scale of colours at the right."""
    image = Image.fromarray(picture)
    h, w = picture.shape[:2]
    d = ImageDraw.Draw(image)
    size = max(9, round(min(w / 62, h / 34)))
    font = ImageFont.truetype(FONT, size)
    ink = tuple(int(255 * v) for v in theme.ink)
    base, edge = h - round(1.2 * size), round(1.6 * size)
    if words:
        d.text((edge, base), words, fill=ink, font=font, anchor="ls")
    if colours is not None:
        width, height = round(0.26 * w), round(0.55 * size)
        x0, y0 = w - edge - width, base - round(1.75 * size)
        row = colours.table[np.linspace(0, 255, width).round().astype(int)]
        strip = np.broadcast_to((255 * row).astype(np.uint8), (height, width, 3))
        image.paste(Image.fromarray(np.ascontiguousarray(strip)), (x0, y0))
        d.text((x0, base), number(colours.lower), fill=ink, font=font, anchor="ls")
        d.text((x0 + width, base), number(colours.upper), fill=ink, font=font, anchor="rs")
        if colours.lower < 0 < colours.upper:
            d.text((x0 + width / 2, base), "0", fill=ink, font=font, anchor="ms")
        d.text((x0 + width / 2, y0 - round(0.5 * size)), title, fill=ink, font=font, anchor="ms")
    return image
