"""YAML as the program reads it, for scripts that change scenes. Needs python3-yaml."""
import re

import yaml


class Loader(yaml.SafeLoader):
    """Numbers and truth as YAML 1.2 has them, like the reader: 1e9 is one, and `on` is a word."""


BOOL = "tag:yaml.org,2002:bool"
Loader.yaml_implicit_resolvers = {first: [(tag, how) for tag, how in rules if tag != BOOL]
                                  for first, rules in Loader.yaml_implicit_resolvers.items()}
Loader.add_implicit_resolver(BOOL, re.compile("^(true|True|TRUE|false|False|FALSE)$"), list("tTfF"))

Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$"), list("-+0123456789."))
