# An environment in which all built-in renderers work. Build it where there is a network:
#
#   docker build -t snellcheck .
#   docker run --rm -v "$PWD:/work" snellcheck run --out reports/latest
#
# What goes in is what the lock file names, by hash; apt brings POV-Ray and libLLVM.
FROM debian:trixie-slim

# Debian keeps one version of each package in a release, so there is none to pin.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --no-install-recommends --yes git libatomic1 libllvm19 povray python3 python3-venv \
    && rm -rf /var/lib/apt/lists/*

COPY requirements/runtime.txt requirements/mitsuba.txt /opt/snellcheck/requirements/
RUN python3 -m venv /opt/venv \
    && /opt/venv/bin/pip install --no-cache-dir --require-hashes \
        -r /opt/snellcheck/requirements/mitsuba.txt

COPY pyproject.toml README.md LICENSE /opt/snellcheck/
COPY harness /opt/snellcheck/harness
COPY tracer /opt/snellcheck/tracer
COPY scenes /opt/snellcheck/scenes
COPY references /opt/snellcheck/references
RUN /opt/venv/bin/pip install --no-cache-dir --no-deps /opt/snellcheck[mitsuba] \
    && useradd --uid 10001 --create-home snell
ENV PATH=/opt/venv/bin:$PATH

# Renderers are other people's programs: nothing of this runs as root.
USER 10001
WORKDIR /work
RUN snellcheck doctor || true
ENTRYPOINT ["snellcheck"]
CMD ["--help"]
