"""The types of the native part name what there is: classes, methods, properties and parameters."""

import ast
import inspect
import pathlib

import pytest
import visibility
from visibility import _visibility

STUBS = ast.parse((pathlib.Path(visibility.__file__).parent / "_visibility.pyi").read_text())


def parameters_of(function):
    """Names of a stub's parameters, those by keyword after a star, without the object itself or its class."""
    given = function.args
    names = [argument.arg for argument in given.posonlyargs + given.args]
    return [name for name in names if name not in ("self", "cls")] + [argument.arg for argument in given.kwonlyargs]


def signature_of(function):
    names = inspect.signature(function).parameters
    return [name for name in names if name != "self"]


@pytest.mark.parametrize("name", [node.name for node in STUBS.body if isinstance(node, ast.ClassDef)])
def test_classes(name):
    (stub,) = (node for node in STUBS.body if isinstance(node, ast.ClassDef) and node.name == name)
    native = getattr(_visibility, name)
    stubs = {node.name: node for node in stub.body if isinstance(node, ast.FunctionDef)}
    own = {key for key in vars(native) if not key.startswith("_")} | {"__len__"} & set(vars(native))
    assert {key for key in stubs if key != "__new__"} == own
    for key, node in stubs.items():
        is_property = any(getattr(mark, "id", "") == "property" for mark in node.decorator_list)
        if is_property:
            assert inspect.isgetsetdescriptor(vars(native)[key]), key
        elif key != "__len__":
            function = native if key == "__new__" else getattr(native, key)
            assert parameters_of(node) == signature_of(function), key


@pytest.mark.parametrize("node", [node for node in STUBS.body if isinstance(node, ast.FunctionDef)], ids=lambda node: node.name)
def test_functions(node):
    assert parameters_of(node) == signature_of(getattr(_visibility, node.name))


def test_all_is_there():
    named = {node.name for node in STUBS.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert named == {key for key in vars(_visibility) if not key.startswith("_")}
    assert set(visibility.__all__) == named
