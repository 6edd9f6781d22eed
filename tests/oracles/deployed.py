"""Holds deploy/'s YAML against Kubernetes' schemas, against itself, and against the real command.

usage: deployed.py HORMA DEPLOY_DIR RENDERED.yaml...

RENDERED are the overlays as `kubectl kustomize` makes them. Every document has to pass the strict schema of
several versions; every Service has to select the pods of one workload and lead to a port that they have;
every volume, secret and claim has to be there; every command has to be one that HORMA parses, and every
HORMA_* variable one that its subcommand knows.
"""

import subprocess
import sys
from pathlib import Path

import kubernetes_validate
import yaml

VERSIONS = ["1.29", "1.31", "1.33", "1.35", "1.37"]
# Made by hand, as the README says.
GIVEN_SECRETS = {"horma-tls": {f"{n}.{k}" for n in ("master", "worker", "client") for k in ("pem", "key")} | {"ca.pem"}}
GIVEN_CLAIMS = {"horma-data"}


def main(horma, deploy, *rendered):
    for file in rendered:
        documents = [d for d in yaml.safe_load_all(Path(file).read_text()) if d]
        for document in documents:
            for version in VERSIONS:
                kubernetes_validate.validate(document, version, strict=True)
        overlay(horma, documents)
        print(f"{file}: {len(documents)} documents, versions {', '.join(VERSIONS)}")
    compose = {name: yaml.safe_load((deploy / "compose" / name).read_text()) for name in ("compose.yaml", "swarm.yaml")}
    for name, file in compose.items():
        composed(horma, file, compose["compose.yaml"], name)
    print("compose.yaml, swarm.yaml")


def overlay(horma, documents):
    workloads = [d for d in documents if "template" in d["spec"]]
    claims = {d["metadata"]["name"] for d in documents if d["kind"] == "PersistentVolumeClaim"} | GIVEN_CLAIMS
    assert len(workloads) == 2, [d["kind"] for d in documents]
    for workload in workloads:
        labels = workload["spec"]["template"]["metadata"]["labels"]
        if workload["kind"] == "Deployment":
            assert workload["spec"]["selector"]["matchLabels"] == labels, labels
        pod(horma, workload["spec"]["template"]["spec"], claims)
    services = {d["metadata"]["name"]: d["spec"] for d in documents if d["kind"] == "Service"}
    for name, service in services.items():
        assert service["publishNotReadyAddresses"] and service["clusterIP"] == "None", name
        chosen = [w for w in workloads if service["selector"].items() <= w["spec"]["template"]["metadata"]["labels"].items()]
        assert len(chosen) == 1, f"{name} selects {len(chosen)} workloads"
        spec = chosen[0]["spec"]["template"]["spec"]
        ports = {p["name"]: p["containerPort"] for c in containers(spec) for p in c.get("ports", [])}
        for port in service["ports"]:
            assert ports[port["targetPort"]] == port["port"], f"{name}: {port} {ports}"
    for workload in workloads:
        for container in containers(workload["spec"]["template"]["spec"]):
            master = option(container["args"], "--master")
            if master and not master.startswith("127.0.0.1:"):
                host, port = master.rsplit(":", 1)
                assert int(port) in [p["port"] for p in services[host]["ports"]], master


def pod(horma, spec, claims):
    volumes = {v["name"]: v for v in spec["volumes"]}
    for volume in volumes.values():
        if "secret" in volume:
            keys = {item["key"] for item in volume["secret"]["items"]}
            assert keys <= GIVEN_SECRETS[volume["secret"]["secretName"]], keys
        else:
            assert volume["persistentVolumeClaim"]["claimName"] in claims, volume
    for container in containers(spec):
        mounts = {m["mountPath"]: volumes[m["name"]] for m in container["volumeMounts"]}
        variables = {e["name"]: e.get("value") for e in container["env"]}
        for name in ("HORMA_TLS_CA", "HORMA_TLS_CERT", "HORMA_TLS_KEY"):
            folder, file = variables[name].rsplit("/", 1)
            assert file in [item["path"] for item in mounts[folder]["secret"]["items"]], variables[name]
        parses(horma, container["args"], variables)
        bound = option(container["args"], "--bind")
        ports = [str(p["containerPort"]) for p in container.get("ports", [])]
        assert ([bound.rsplit(":", 1)[1]] if bound else []) == ports, f"{bound} {ports}"


def containers(spec):
    return spec.get("initContainers", []) + spec["containers"]


def composed(horma, file, base, name):
    for role, service in file["services"].items():
        variables = service.get("environment", {})
        parses(horma, base["services"][role]["command"], variables)
        for variable, value in variables.items():
            if variable.startswith("HORMA_TLS_"):
                secret = value.removeprefix("/run/secrets/")
                assert secret in service["secrets"] and secret in base["secrets"], f"{name}: {value}"
            if variable == "HORMA_MASTER":
                host, port = value.removeprefix("tasks.").rsplit(":", 1)
                ports = base["services"][host]["ports"]
                bound = base["services"][host]["environment"]["HORMA_BIND"]
                assert bound.endswith(f":{port}") and int(port) in [p["target"] for p in ports], f"{name}: {value}"


def parses(horma, args, variables):
    """With --help at its end a command is read from left to right and not carried out."""
    ran = subprocess.run([horma, *args, "--help"], capture_output=True, text=True)
    assert ran.returncode == 0, f"{args}: {ran.stderr}"
    known = " ".join(ran.stdout.split())
    for name in variables:
        assert not name.startswith("HORMA_") or f"[env: {name}=" in known, f"{args[0]} knows no {name}"


def option(args, name):
    return args[args.index(name) + 1] if name in args else None


main(sys.argv[1], Path(sys.argv[2]), *sys.argv[3:])
