"""What happens in the processes that run tests: look what they run, put a fault in, run them until one notices.

Most faults are in the body of a function. For these one process gathers every test of a subject and is forked for each
fault: the child exchanges the code of that function and runs the tests that run its lines. What a module does while it
is imported (tables, constants, defaults of arguments) takes a process that has imported nothing of the project yet: an
import hook gives it the changed source. Nothing is ever written into the tree.
"""

from __future__ import annotations

import gc
import importlib
import os
import signal
import sys
import threading
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from types import CodeType, FrameType, FunctionType
from typing import Any, NamedTuple

import pytest

from scripts.mutants.forks import LATE, each
from scripts.mutants.subjects import ROOT, Fault, Subject, Verdict, Wish

PATIENCE = 300.0
"""s of processor time in which all tests of a subject must have run once."""
COLD = 5.0
"""s of processor time that a test may last besides: the first one that needs something pays for its import, and what
ends it for that would count as having noticed a fault."""
Line = tuple[str, int]


class Seen(NamedTuple):
    """What one run of all tests has shown: how long each lasts (s), which lines of the subject it runs, who failed.

    `others` are the modules of other people that were imported on the way.
    """

    lasted: dict[str, float]
    ran: dict[str, frozenset[Line]]
    failed: list[str]
    others: list[str]


class Order:
    """Which tests meet a fault, and in which order: those that have noticed most come first."""

    def __init__(self, subject: Subject, seen: Seen) -> None:
        self.lasted = {name: took for name, took in seen.lasted.items() if took <= subject.longest}
        self.known = frozenset(seen.lasted)
        self.kills: Counter[str] = Counter()
        self._files: defaultdict[str, Counter[str]] = defaultdict(Counter)
        self._by_line: defaultdict[Line, set[str]] = defaultdict(set)
        for name in self.lasted:
            for line in seen.ran[name]:
                self._by_line[line].add(name)

    @property
    def limit(self) -> float:
        """How long a child may last (s)."""
        return 2 * COLD + 3 * sum(self.lasted.values())

    def noticed(self, file: str, by: str) -> None:
        """A fault of this file was noticed by that test."""
        self.kills[by] += 1
        self._files[file][_file(by)] += 1

    def files(self, fault: Fault) -> list[str]:
        """The test files whose tests meet this fault, in the order in which they have noticed faults of its file."""
        kills = self._files[fault.file]
        files = dict.fromkeys(map(_file, self.of(fault)))
        return sorted(files, key=lambda file: -kills[file])

    def of(self, fault: Fault) -> list[str]:
        """The fast tests that run one of its lines; all of them for what happens at import, which may show anywhere."""
        found = set[str]()
        if fault.mutant.swapped:
            found = found.union(*(self._by_line[fault.path, line] for line in fault.mutant.lines))
        found = found or set(self.lasted)  # a function that runs at import only is one of these too
        return sorted(found, key=lambda name: (-self.kills[name], self.lasted[name], name))


def _file(test: str) -> str:
    return test.split("::")[0]


class _Tests:
    """A pytest plugin that runs tests one after the other until one fails."""

    def __init__(self) -> None:
        self.failed = ""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed and not self.failed:
            self.failed = report.nodeid

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed and not self.failed:
            self.failed = report.nodeid or "collection"

    def run(self, items: Sequence[pytest.Item], lasted: Mapping[str, float]) -> str:
        """The name of the first that failed, "" when all passed. One that lasts much too long ends this process."""
        for item, following in zip(items, [*items[1:], None], strict=True):
            signal.setitimer(signal.ITIMER_PROF, COLD + 5 * lasted.get(item.nodeid, 1.0))
            signal.setitimer(signal.ITIMER_REAL, LATE * COLD + 10 * lasted.get(item.nodeid, 1.0))
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if self.failed:
                break
        return self.failed

    @pytest.hookimpl(trylast=True)
    def pytest_configure(self) -> None:
        """Examples that fail are not made smaller: that they fail is all that counts."""
        from hypothesis import Phase, settings

        usual = settings.get_profile("test")
        settings.register_profile("mutants", usual, phases=(Phase.explicit, Phase.generate), database=None)
        settings.load_profile("mutants")


def _pytest(plugin: object, tests: Sequence[str], scratch: str) -> int:
    """Start it here, silent (unless MUTANTS_LOUD is set), with nothing that writes into the tree."""
    os.chdir(ROOT)
    if not os.environ.get("MUTANTS_LOUD"):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
    sys.dont_write_bytecode = True
    quiet = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-o", "timeout=0", "--no-header"]
    quiet += ["-W", "ignore::pytest.PytestAssertRewriteWarning", "--basetemp", f"{scratch}/{os.getpid()}"]
    return int(pytest.main([*quiet, *tests], plugins=[plugin]))


# --- faults in functions ---------------------------------------------------------------------------------------------


class Gathered(_Tests):
    """A process that has every test of a subject gathered, and forks for each fault."""

    def __init__(self, subject: Subject, wish: Wish, scratch: str) -> None:
        super().__init__()
        self.subject, self.wish, self.scratch = subject, wish, scratch
        self.told: list[Fault] = []
        self.result: Any = None
        self.functions: dict[tuple[str, str, int], list[FunctionType]] = {}
        self.items: dict[str, pytest.Item] = {}

    def judge(self, told: list[Fault]) -> Any:
        """What all tests have shown, and a verdict on each fault; in words, what hindered it."""
        self.told = told
        status = _pytest(self, self.subject.tests, self.scratch)
        return self.result or f"pytest gave {status} for the tests of {self.subject.name}: {self.failed}"

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """In place of running the tests once."""
        gc.unfreeze()  # what the tests of this project freeze is what is looked for here
        self.functions = _functions({str(ROOT / file) for file in self.subject.files})
        gc.freeze()
        self.items = {item.nodeid: item for item in session.items}
        for _, seen in each([session], lambda _: self._look(), PATIENCE, at_once=1):
            self.result = self._judged(seen) if seen else "the tests took too long"
        return True

    def _look(self) -> Seen:
        """In a child: run everything once."""
        files = {str(ROOT / file) for file in self.subject.files}
        lasted, ran, failed = {}, {}, []
        items = list(self.items.values())
        for item, following in zip(items, [*items[1:], None], strict=True):
            self.failed, begun = "", time.process_time()
            with _Traced(files) as lines:
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            lasted[item.nodeid], ran[item.nodeid] = time.process_time() - begun, frozenset(lines)
            failed += [self.failed] if self.failed else []
        return Seen(lasted, ran, failed, _others())

    def _judged(self, seen: Seen) -> Any:
        if seen.failed:
            return f"without any fault these fail: {', '.join(seen.failed)}"
        order, verdicts = Order(self.subject, seen), list[Verdict]()
        todo = [fault for fault in self.told if order.of(fault)]
        self.wish.tell(f"{len(order.lasted)} fast tests, {sum(order.lasted.values()):.1f} s")
        for fault, by in each(todo, lambda fault: self._try(fault, order), order.limit, self.wish.at_once):
            verdicts.append(Verdict(fault.name, "time" if by is None else by))
            order.noticed(fault.file, verdicts[-1].by)
            self.wish.tell(progress(verdicts, len(todo)))
        return seen, verdicts

    def _try(self, fault: Fault, order: Order) -> str:
        """In a child: exchange the code of one function and run the tests that run its lines."""
        for code in _codes(fault.mutant.code(fault.tree, fault.path)):
            for function in self.functions.get((fault.path, code.co_qualname, code.co_firstlineno), ()):
                if len(code.co_freevars) != len(function.__code__.co_freevars):
                    return ""  # it takes a new import
                function.__code__ = code
        return self.run([self.items[name] for name in order.of(fault)], order.lasted)


def _others() -> list[str]:
    """Modules that were installed or belong to Python: none that lies in a folder of this project."""
    return [name for name, module in sys.modules.items() if not any(map(_ours, _places(module)))]


def _places(module: object) -> list[str]:
    file = getattr(module, "__file__", None)
    return [file] if file else list(getattr(module, "__path__", ()))


def _ours(path: str) -> bool:
    return path.startswith(f"{ROOT}/") and "/site-packages/" not in path


def progress(verdicts: Sequence[Verdict], of: int) -> str:
    """What is worth telling after the last of these: that it survives, now and then how far it is; else ""."""
    if not verdicts[-1].by:
        return f"survives so far: {verdicts[-1].fault}"
    if len(verdicts) % 50 and len(verdicts) != of:
        return ""
    return f"{len(verdicts)} of {of}, {sum(not one.by for one in verdicts)} survive"


def _functions(files: set[str]) -> dict[tuple[str, str, int], list[FunctionType]]:
    """Every function of these files, by file, name and first line."""
    found = defaultdict(list)
    for one in gc.get_objects():
        if isinstance(one, FunctionType) and one.__code__.co_filename in files:
            code = one.__code__
            found[code.co_filename, code.co_qualname, code.co_firstlineno].append(one)
    return found


def _codes(code: CodeType) -> Iterator[CodeType]:
    """The code of functions of a module and of its classes, not of what is inside functions."""
    for one in code.co_consts:
        if isinstance(one, CodeType):
            if one.co_flags & 0x2:  # CO_NEWLOCALS: a function; the body of a class has none
                yield one
            else:
                yield from _codes(one)


class _Traced:
    """Keeps the lines of some files that are run in between, in every thread that begins meanwhile too."""

    def __init__(self, files: set[str]) -> None:
        self.files = files
        self.lines: set[Line] = set()

    def __enter__(self) -> set[Line]:
        threading.settrace(self._call)
        sys.settrace(self._call)
        return self.lines

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)
        threading.settrace(None)

    def _call(self, frame: FrameType, event: str, argument: object) -> Any:
        return self._line if frame.f_code.co_filename in self.files else None

    def _line(self, frame: FrameType, event: str, argument: object) -> Any:
        self.lines.add((frame.f_code.co_filename, frame.f_lineno))
        return self._line


# --- faults that take a new import -----------------------------------------------------------------------------------


class Anew(_Tests):
    """In a child that has imported nothing of the project: import the changed source and run the tests that are due."""

    def __init__(self, fault: Fault, order: Order, scratch: str) -> None:
        super().__init__()
        self.fault, self.order, self.scratch = fault, order, scratch

    def judge(self) -> str:
        """The test that has noticed the fault, "" for none. The file whose tests notice most is gathered first."""
        for name in set(sys.modules) - set(_others()):
            del sys.modules[name]  # there are some only where a test asks for a trial
        changed = _Changed(self.fault)
        sys.meta_path.insert(0, changed)
        sys.path[:0] = [str(ROOT / "src"), str(ROOT)]
        try:
            importlib.import_module(
                changed.module
            )  # before pytest has a hook of its own that would come first
        except Exception as error:
            return f"import: {type(error).__name__}"
        first, *rest = self.order.files(self.fault)
        for files in ([first], rest):
            status = _pytest(self, files, self.scratch) if files and not self.failed else 0
            if status not in (0, 5) and not self.failed:
                return f"pytest gave {status}"
        return self.failed

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """In place of running all of them in the order of their files. Tests that only this fault brings count too."""
        if not self.failed:
            items = {item.nodeid: item for item in session.items}
            names = [name for name in self.order.of(self.fault) if name in items]
            names += [name for name in items if name not in self.order.known]
            self.run([items[name] for name in names], self.order.lasted)
        return True


class _Changed(MetaPathFinder):
    """Finds the one module that is changed."""

    def __init__(self, fault: Fault) -> None:
        self.fault = fault
        self.module = (
            fault.file.removeprefix("src/").removesuffix(".py").replace("/", ".").removesuffix(".__init__")
        )

    def find_spec(self, fullname: str, path: object, target: object = None) -> ModuleSpec | None:
        """Its loader, when it is this one."""
        if fullname != self.module:
            return None
        loader = _Source(fullname, self.fault.path)
        loader.fault = self.fault
        return spec_from_file_location(fullname, self.fault.path, loader=loader)


class _Source(SourceFileLoader):
    """Gives the changed code of a module, and keeps none of it."""

    fault: Fault

    def get_code(self, fullname: str) -> CodeType:
        """As it is with the fault in it."""
        code = self.fault.mutant.code(self.fault.tree, self.fault.path)
        assert isinstance(code, CodeType)
        return code
