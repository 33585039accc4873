# The coordinator: `docker build -f docs/deploy/coordinator.Dockerfile -t tracktwin .`
FROM rust:1.95-slim-bookworm AS build
RUN apt-get update && apt-get install -y --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
WORKDIR /src
# Without line tables, which would be four fifths of the program.
ENV CARGO_PROFILE_RELEASE_STRIP=debuginfo
COPY . .
# Registry and target folder stay in the cache between builds; the program is copied out of it.
RUN --mount=type=cache,target=/usr/local/cargo/registry --mount=type=cache,target=/src/target \
    cargo build --release --locked --bin tracktwin && cp target/release/tracktwin /tracktwin

FROM debian:bookworm-slim
RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates curl \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --system --uid 10001 --create-home --home-dir /var/lib/tracktwin tracktwin
COPY --from=build /tracktwin /usr/local/bin/tracktwin
USER tracktwin
WORKDIR /var/lib/tracktwin
EXPOSE 7700 7780
# Healthy: the library responds.
HEALTHCHECK --interval=10s --timeout=5s --start-period=20s \
    CMD curl --fail --silent http://127.0.0.1:7780/healthz
ENTRYPOINT ["tracktwin"]
CMD ["coordinator"]
