"""From what a user types to what a library has: names, aliases checked by hand, suggestions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from difflib import get_close_matches

from d4cad.errors import InputError

ALIASES: Mapping[str, str] = {
    "aeroplane": "airplane",
    "auto": "car",
    "automobile": "car",
    "beer": "beer-stein",
    "bike": "bicycle",
    "boot print": "boot",
    "bottle": "beer-bottle",
    "bulb": "lightbulb",
    "bull": "cow",
    "camp": "tent",
    "cap": "baseball-cap",
    "castle": "castle-turret",
    "cell": "battery-full",
    "cloth": "t-shirt",
    "clothes": "t-shirt",
    "cog": "gear",
    "cup": "coffee",
    "dice": "dice-five",
    "die": "dice-five",
    "envelope": "envelope",
    "evergreen": "tree-evergreen",
    "fir": "tree-evergreen",
    "flame": "fire",
    "floppy": "floppy-disk",
    "ghost": "ghost",
    "glasses": "eyeglasses",
    "goblet": "wine",
    "hat": "cowboy-hat",
    "heart shape": "heart",
    "home": "house",
    "icecream": "ice-cream",
    "jug": "beer-stein",
    "kitten": "cat",
    "kitty": "cat",
    "light bulb": "lightbulb",
    "lotus": "flower-lotus",
    "magnifier": "magnifying-glass",
    "man": "person",
    "man standing": "person",
    "standing man": "person",
    "mail": "envelope",
    "mitten": "boxing-glove",
    "motorbike": "motorcycle",
    "mountain": "mountains",
    "mug": "coffee",
    "note": "music-note",
    "padlock": "lock",
    "palm": "tree-palm",
    "palm tree": "tree-palm",
    "paw": "paw-print",
    "pine": "tree-evergreen",
    "plane": "airplane",
    "puppy": "dog",
    "puzzle": "puzzle-piece",
    "racket": "racquet",
    "tennis racket": "racquet",
    "sail boat": "sailboat",
    "scissor": "scissors",
    "shirt": "t-shirt",
    "shoe": "sneaker",
    "snail shell": "spiral",
    "sofa": "couch",
    "spectacles": "eyeglasses",
    "spanner": "wrench",
    "sport shoe": "sneaker",
    "tee": "t-shirt",
    "thunderbolt": "lightning",
    "trousers": "pants",
    "tulip": "flower-tulip",
    "tv": "television",
    "ufo": "flying-saucer",
    "water drop": "drop",
    "wine glass": "wine",
    "wineglass": "wine",
}
"""What a word fetches that is no name itself. Phosphor's own tags are not used for this: they are topics, and "key"
would fetch a triangle."""


def normal(text: str) -> str:
    """A prompt as names have it: small letters, words joined by hyphens, no article.

    Raises InputError for an empty prompt or one without a Latin letter.
    """
    words = re.findall(r"[a-z0-9]+", text.lower())
    if not words and any(map(str.isalnum, text)):
        raise InputError(f"the prior knows English words only, got {text!r}")
    if not words:
        raise InputError("the prompt is empty, expected a word such as star")
    return "-".join(words[1:] if len(words) > 1 and words[0] in ("a", "an", "the") else words)


def aliased(word: str) -> str:
    """The name that a word in the form of a name is an alias of, or that word."""
    return ALIASES.get(word.replace("-", " "), word)


def found(text: str, names: Iterable[str], tags: Mapping[str, Iterable[str]] | None = None) -> str:
    """The name that a prompt means: that name, an alias of it, or its singular or plural.

    tags: of each name, for suggestions. Raises InputError for an empty or unknown prompt.
    """
    known = set(names)
    word = normal(text)
    for form in forms(word):
        if form in known:
            return form
        if aliased(form) in known:
            return aliased(form)
    close = suggestions(word, known, tags or {})
    hint = f": did you mean {' or '.join(close)}?" if close else ""
    raise InputError(f"the prior does not know {text.strip()!r}{hint}")


def forms(word: str) -> list[str]:
    """A word, its singular and its plurals."""
    singular = [word.removesuffix(end) for end in ("s", "es") if word.endswith(end) and len(word) > 3]
    return [word, *singular, f"{word}s", f"{word}es"]


def suggestions(word: str, names: Iterable[str], tags: Mapping[str, Iterable[str]]) -> list[str]:
    """At most three names: of like spelling, else with that word in them, else so tagged."""
    names = sorted(names)
    spelled = {alias.replace(" ", "-"): name for alias, name in ALIASES.items() if name in names}
    close = get_close_matches(word, [*names, *spelled], n=3, cutoff=0.8)
    parts = [name for name in names if set(word.split("-")) & set(name.split("-"))]
    tagged = [name for name in names if word in tags.get(name, ())]
    return list(dict.fromkeys([*close, *sorted(parts, key=len), *sorted(tagged, key=len)]))[:3]


TRAINED = """
acorn airplane anchor armchair atom avocado axe backpack balloon barn baseball basketball bed bell belt bicycle bird
boat bomb bone book boot bridge bug bus butterfly cactus cake camera campfire car carrot cat chair cherries church
circle clock cloud clover coffee couch cow crane cross crown cube diamond dog door dress drop ear egg envelope eye
eyeglasses feather fire fish flag flask flower gear ghost gift globe guitar hamburger hammer hand headphones heart
hexagon hoodie horse hourglass house island key keyboard knife ladder lamp laptop leaf lightbulb lighthouse lightning
lock magnet microphone microscope moon motorcycle mountains mouse needle nut octagon pants parachute pen pencil
pentagon pepper person phone pizza planet plant rabbit racquet rainbow robot rocket ruler sailboat scales scissors
scooter screwdriver shield shovel shower skull smiley sneaker snowflake sock spade spiral square star sun sunglasses
sword syringe television tent thermometer ticket tire tooth train tram tree triangle trophy truck umbrella volleyball
watch wine wrench baseball-cap battery-full beach-ball beer-bottle beer-stein bowling-ball boxing-glove car-profile
castle-turret cloud-moon cloud-sun cowboy-hat dice-five fish-simple floppy-disk flower-lotus flower-tulip
flying-saucer hard-hat heart-straight house-line ice-cream magnifying-glass moon-stars music-note paint-brush
paper-plane paw-print potted-plant puzzle-piece shooting-star shopping-cart soccer-ball star-four t-shirt tennis-ball
tree-evergreen tree-palm
"""
"""Names that the trained prior learns: things with a shape of their own."""
