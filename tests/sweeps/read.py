"""Checks the Job of a sweep against the schema of Kubernetes.

    python3 read.py DIR/kubernetes.yaml
"""

import sys

import kubernetes_validate
import yaml

KUBERNETES = "1.30"


def validate(manifest):
    with open(manifest, encoding="utf-8") as file:
        job = yaml.safe_load(file)
    kubernetes_validate.validate(job, KUBERNETES, strict=True)
    shards, words = job["spec"]["completions"], job["spec"]["template"]["spec"]["containers"][0]["command"]
    assert job["spec"]["completionMode"] == "Indexed" and f"--shards {shards}" in words[-1], words
    # Proves that the check can fail.
    job["spec"]["completions"] = "many"
    try:
        kubernetes_validate.validate(job, KUBERNETES, strict=True)
    except kubernetes_validate.ValidationError:
        print(f"kubernetes-validate: a Job of Kubernetes {KUBERNETES} with {shards} shards")
    else:
        raise AssertionError("kubernetes-validate accepts a Job with many completions")


if __name__ == "__main__":
    validate(sys.argv[1])
