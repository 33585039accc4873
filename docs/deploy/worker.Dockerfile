# A worker: `docker build -f docs/deploy/worker.Dockerfile -t tracktwin-worker .`
#
# Build both images from one commit: a worker with other physics is refused.
FROM rust:1.95-slim-bookworm AS build
RUN apt-get update && apt-get install -y --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
WORKDIR /src
# Without line tables, which would be four fifths of the program.
ENV CARGO_PROFILE_RELEASE_STRIP=debuginfo
COPY . .
RUN --mount=type=cache,target=/usr/local/cargo/registry --mount=type=cache,target=/src/target \
    cargo build --release --locked -p tracktwin-worker && cp target/release/tracktwin-worker /tracktwin-worker

FROM debian:bookworm-slim
RUN apt-get update && apt-get install -y --no-install-recommends curl \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --system --uid 10001 --no-create-home tracktwin
COPY --from=build /tracktwin-worker /usr/local/bin/tracktwin-worker
USER tracktwin
ENV TRACKTWIN_HEALTH=127.0.0.1:7701
# Healthy: the worker responds, also while it waits for a coordinator.
HEALTHCHECK --interval=10s --timeout=5s CMD curl --fail --silent http://127.0.0.1:7701/healthz
# It finishes or returns its cases within ten seconds.
STOPSIGNAL SIGTERM
ENTRYPOINT ["tracktwin-worker"]
