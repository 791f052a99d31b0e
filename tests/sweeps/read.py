"""What others make of the files of a sweep: pyarrow reads results.parquet, which must say what results.csv says, value by value;
kubernetes-validate holds the Job against the schema of Kubernetes.

    python3 read.py DIR/results.csv DIR/results.parquet DIR/kubernetes.yaml
"""

import csv
import sys

import kubernetes_validate
import pyarrow
import pyarrow.parquet
import yaml

# A column of numbers is double, with nulls where CSV has nothing.
READ = {
    pyarrow.int64(): int,
    pyarrow.string(): str,
    pyarrow.bool_(): lambda text: {"true": True, "false": False}[text],
    pyarrow.float64(): lambda text: float(text) if text else None,
}
KUBERNETES = "1.30"


def compare(csv_file, parquet_file):
    with open(csv_file, newline="", encoding="utf-8") as file:
        titles, *rows = csv.reader(file)
    table = pyarrow.parquet.read_table(parquet_file)
    assert table.column_names == titles, f"columns {table.column_names}, in CSV {titles}"
    assert table.num_rows == len(rows), f"{table.num_rows} rows, in CSV {len(rows)}"
    for index, field in enumerate(table.schema):
        read = READ[field.type]
        for number, (value, row) in enumerate(zip(table.column(index).to_pylist(), rows)):
            expected = read(row[index])
            assert value == expected, f"row {number}, {field.name}: {value!r}, in CSV {expected!r}"
    kinds = ", ".join(sorted({str(field.type) for field in table.schema}))
    print(f"pyarrow {pyarrow.__version__}: {table.num_rows} rows, {table.num_columns} columns ({kinds}), as in CSV")


def validate(manifest):
    with open(manifest, encoding="utf-8") as file:
        job = yaml.safe_load(file)
    kubernetes_validate.validate(job, KUBERNETES, strict=True)
    shards, words = job["spec"]["completions"], job["spec"]["template"]["spec"]["containers"][0]["command"]
    assert job["spec"]["completionMode"] == "Indexed" and f"--shards {shards}" in words[-1], words
    # A check that cannot fail is none.
    job["spec"]["completions"] = "many"
    try:
        kubernetes_validate.validate(job, KUBERNETES, strict=True)
    except kubernetes_validate.ValidationError:
        print(f"kubernetes-validate: a Job of Kubernetes {KUBERNETES} with {shards} shards")
    else:
        raise AssertionError("kubernetes-validate accepts a Job with many completions")


if __name__ == "__main__":
    compare(sys.argv[1], sys.argv[2])
    validate(sys.argv[3])
