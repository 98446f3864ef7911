"""Take: a clip with labels, as datasets yield them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from bench.motion.clip import Clip


@dataclass(frozen=True, eq=False)
class Take:
    """A labelled clip.

    Attributes
    ----------
    clip : the motion, on the canonical 21 joints.
    take_id : unique within its dataset; sorting take ids of one cell gives recording order. Empty when hidden.
    dataset : the dataset's name. Empty when hidden.
    content, style : labels; ``None`` when hidden from a method or unknown.
    actor : who performed it; session: which recording session, where known.
    """

    clip: Clip
    take_id: str = ""
    dataset: str = ""
    content: str | None = None
    style: str | None = None
    actor: str | None = None
    session: str | None = None

    def hidden(self, *, content: bool, style: bool) -> Take:
        """What a method may see: no ids, no actor; labels only where declared as needed."""
        return Take(self.clip, content=self.content if content else None, style=self.style if style else None)

    def with_clip(self, clip: Clip) -> Take:
        """The same labels on another clip."""
        return replace(self, clip=clip)
