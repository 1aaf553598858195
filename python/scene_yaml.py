"""YAML as the program reads it, for scripts that change scenes. Needs python3-yaml."""
import re

import yaml


class Loader(yaml.SafeLoader):
    """Numbers as YAML 1.2 has them, like the reader: 1e9 is one."""


Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$"), list("-+0123456789."))
