"""The code of docs/python.md, from top to bottom."""

import contextlib
import io
import os
import re
import tempfile
import unittest
from pathlib import Path

import rollwalk

PAGE = Path(__file__).resolve().parents[3] / "docs" / "python.md"


class Tutorial(unittest.TestCase):
    def test_the_page_runs(self) -> None:
        text = PAGE.read_text(encoding="utf-8")
        blocks = list(re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))
        self.assertGreater(len(blocks), 8)
        said = io.StringIO()
        names: dict[str, object] = {}
        home = os.getcwd()
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(said):
            os.chdir(folder)
            self.addCleanup(os.chdir, home)
            for block in blocks:
                # Errors show the line of the page.
                line = text.count("\n", 0, block.start(1))
                exec(compile("\n" * line + block.group(1), str(PAGE), "exec"), names)
            os.chdir(home)
        run, why = names["run"], said.getvalue()
        self.assertIsInstance(run, rollwalk.Simulation)
        self.assertTrue(run.holds)
        # Output according to the page.
        self.assertIn("would do:", why)
        self.assertLess(names["further"].iterations, names["plan"].iterations)
        power = names["of_drive"].gradients["power"]
        self.assertEqual(power.shape, (2,))


if __name__ == "__main__":
    unittest.main()
