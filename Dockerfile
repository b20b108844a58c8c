# docker build -t oted . && docker run --rm -v "$PWD:/work" oted design arm.toml --out runs/arm
# The first stage compiles a wheel, which carries the program and the Debian libraries that it needs; the second has only that.
FROM debian:12 AS build
RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates make python3-venv python3-dev
COPY . /oted
WORKDIR /oted
RUN make wheel

FROM debian:12-slim
# For films: OpenGL in software.
RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates python3-venv libegl1 libgl1-mesa-dri \
  && rm -rf /var/lib/apt/lists/*
COPY --from=build /oted/dist /tmp/dist
RUN python3 -m venv /opt/oted && /opt/oted/bin/pip install --no-cache-dir /tmp/dist/oted-*.whl && rm -r /tmp/dist
ENV PATH=/opt/oted/bin:$PATH
WORKDIR /work
ENTRYPOINT ["oted"]
