//! Export of steps to a collector, by OTLP over gRPC.

use opentelemetry::global;
use opentelemetry_otlp::{ExporterBuildError, SpanExporter};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::trace::SdkTracerProvider;

/// Environment variables with the address of a collector. Without one of them nothing is traced.
const ENDPOINTS: [&str; 2] = ["OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT"];

/// Exporter of the steps of this process. On drop it sends the remaining steps.
pub struct Export(Option<SdkTracerProvider>);

/// The exporter for the collector in the environment cannot be created.
#[derive(Debug)]
pub struct ExportError(ExporterBuildError);

impl std::fmt::Display for ExportError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: write http://HOST:PORT: {}", ENDPOINTS[0], self.0)
    }
}

impl std::error::Error for ExportError {}

impl Export {
    /// Creates an exporter to the collector in `OTEL_EXPORTER_OTLP_ENDPOINT`, if this variable is set.
    /// Other variables of `OpenTelemetry` also apply, such as `OTEL_TRACES_SAMPLER` and
    /// `OTEL_SERVICE_NAME`; the default of the latter is `service`. Call this function within a Tokio
    /// runtime.
    ///
    /// # Errors
    /// [`ExportError`] if the address is invalid.
    pub fn from_environment(service: &str) -> Result<Self, ExportError> {
        let said = |name: &str| std::env::var(name).ok().filter(|it| !it.is_empty());
        if !ENDPOINTS.iter().any(|name| said(name).is_some()) {
            return Ok(Self(None));
        }
        let exporter = SpanExporter::builder().with_tonic().build().map_err(ExportError)?;
        let service = said("OTEL_SERVICE_NAME").unwrap_or_else(|| service.to_owned());
        let provider = SdkTracerProvider::builder()
            .with_batch_exporter(exporter)
            .with_resource(Resource::builder().with_service_name(service).build())
            .build();
        global::set_tracer_provider(provider.clone());
        Ok(Self(Some(provider)))
    }
}

impl Drop for Export {
    fn drop(&mut self) {
        if let Some(provider) = &self.0 {
            // Traces are lost while the collector is unreachable, with a warning in the log; the
            // farm continues.
            let _ = provider.shutdown();
        }
    }
}
