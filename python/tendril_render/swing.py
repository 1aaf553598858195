"""A mode about an equilibrium as frames to draw."""
import numpy as np
from tendril import edge_frames

from .source import Mistake

TURN = 0.5  # of an edge or body that turns most, where nothing moves [rad]


def turned(vectors, axes, angles):
    """Vectors (..., 3) turned about unit axes by angles (Rodrigues)."""
    cos, sin = np.cos(angles)[..., None], np.sin(angles)[..., None]
    along = np.sum(axes * vectors, -1, keepdims=True)
    return cos * vectors + sin * np.cross(axes, vectors) + (1 - cos) * along * axes


class Swing:
    """A trajectory whose frames are a mode about its last one, a buckling mode about that at its load, with the
    deflections in `time`; the rest is as there."""

    time_name = "deflection"

    def __init__(self, t, number, share, turns):
        """number: of the mode, from 1; share: the largest displacement over the size of all; turns: where each frame is
        in the swing [rad], 0 at its end; flutter adds the sine times its other shape to the cosine times its own."""
        modes = t.modes
        if modes is None:
            raise Mistake("--mode: this run has no modes; run it with -mode modes or -mode buckling")
        if not 1 <= number <= len(modes.shape):
            raise Mistake(f"--mode {number}: the run has modes 1 to {len(modes.shape)}")
        k, self._at = number - 1, -1
        if modes.load_factor is not None:
            self._at = int(np.argmin(np.abs(t.time - modes.load_factor[k])))
            what = f"load factor {modes.load_factor[k]:.6g}"
        elif modes.growth_rate[k] > 0 and modes.frequency[k] > 0:
            what = f"flutters with {modes.frequency[k]:.4g} rad/s, grows by {modes.growth_rate[k]:.4g}/s"
        elif modes.growth_rate[k] > 0:
            what = f"grows by {modes.growth_rate[k]:.4g}/s"
        else:
            what = f"{modes.frequency[k]:.4g} rad/s"
        self.words = f"mode {number}: {what}"
        self._t, self.time, self._sine = t, np.cos(turns), np.sin(turns)
        pair = self._pair(modes, k)
        moved = [np.linalg.norm(v, axis=-1).max(initial=0) for v in (modes.shape[pair], modes.body_shape[pair])]
        spun = [np.abs(modes.twist[pair]).max(initial=0),
                np.linalg.norm(modes.body_rotation[pair], axis=-1).max(initial=0)]
        size = np.linalg.norm(np.ptp(t.field("position")[self._at], axis=0))
        only_turns = max(moved) < 1e-6 * size * max(spun)
        scale = TURN / max(spun) if only_turns else share * size / max(moved)
        self._shape, self._twist = scale * modes.shape[pair], scale * modes.twist[pair]
        self._body_shape, self._body_rotation = scale * modes.body_shape[pair], scale * modes.body_rotation[pair]
        self.rods = [self._rod(rod) for rod in t.rods]
        self.bodies = [self._body(body) for body in t.bodies]

    @staticmethod
    def _pair(modes, k):
        """The mode, and where it flutters the other of its pair, which are those of a growth rate and a frequency in
        order."""
        flutters = np.zeros(len(modes.shape), bool)
        if modes.load_factor is None:
            flutters = (modes.growth_rate > 0) & (modes.frequency > 0)
        if not flutters[k]:
            return [k]
        first = k - int(np.sum(flutters[:k])) % 2
        return [first, first + 1]

    def _at_frame(self, shapes, frame):
        """The motion of a frame; shapes: of one mode, or of two that flutter."""
        return self.time[frame] * shapes[0] + (self._sine[frame] * shapes[1] if len(shapes) > 1 else 0)

    def __getattr__(self, name):
        return getattr(self._t, name)

    def _rod(self, rod):
        at, x, d = self._at, rod.position(self._at), rod.director(self._at)
        shape = self._shape[:, rod.first_vertex : rod.first_vertex + rod.vertices]
        twist = self._twist[:, rod.first_edge : rod.first_edge + rod.edges]
        before, field = edge_frames(x, d)[2], rod.field

        def director(frame=-1):
            after = edge_frames(rod.position(frame), d)[2]
            axis = np.cross(before, after)
            sine = np.linalg.norm(axis, axis=-1, keepdims=True)
            bent = turned(d, axis / np.maximum(sine, 1e-300), np.arctan2(sine[..., 0], np.sum(before * after, -1)))
            return turned(bent, after, self._at_frame(twist, frame))

        rod.position = lambda frame=-1: x + self._at_frame(shape, frame)
        rod.director = director
        rod.field = lambda name, frame=-1: field(name, at)
        return rod

    def _body(self, body):
        (x, q), k = body.pose(self._at), body.index

        def pose(frame=-1):
            spin = self._at_frame(self._body_rotation[:, k], frame)
            angle = np.linalg.norm(spin)
            axis = spin / max(angle, 1e-300) * np.sin(angle / 2)
            w = np.cos(angle / 2)
            product = [w * q[0] - axis @ q[1:], *(w * q[1:] + q[0] * axis + np.cross(axis, q[1:]))]
            return x + self._at_frame(self._body_shape[:, k], frame), np.array(product)

        body.pose = pose
        return body
