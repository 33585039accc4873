//! One step of a trace.

use opentelemetry::propagation::TextMapPropagator;
use opentelemetry::trace::{Link, SpanBuilder, Status, TraceContextExt, Tracer};
use opentelemetry::{Context, KeyValue, Value, global};
use opentelemetry_sdk::propagation::TraceContextPropagator;
use std::collections::HashMap;
use std::time::SystemTime;

/// Name of the header of the W3C Trace Context.
const TRACEPARENT: &str = "traceparent";

/// A step (span) of a trace in progress. The step ends when the value is dropped.
pub struct Step(Context);

impl Step {
    /// Starts the first step of a trace, with the start time `begun`.
    pub fn first(name: &'static str, begun: SystemTime) -> Self {
        let step = SpanBuilder::from_name(name).with_start_time(begun);
        Self::begin(step, &Context::new())
    }

    /// Starts a step that follows other steps, given by their [`Step::traceparent`]. The step belongs to
    /// the trace of the first of them and has links to the others. Invalid trace contexts are ignored.
    pub fn after<'a>(
        name: &'static str,
        earlier: impl IntoIterator<Item = &'a (impl AsRef<str> + ?Sized + 'a)>,
    ) -> Self {
        let mut earlier = earlier
            .into_iter()
            .map(|it| context(it.as_ref()))
            .filter(|it| it.span().span_context().is_valid());
        let parent = earlier.next().unwrap_or_default();
        let links = earlier.map(|it| Link::with_context(it.span().span_context().clone()));
        Self::begin(SpanBuilder::from_name(name).with_links(links.collect()), &parent)
    }

    fn begin(step: SpanBuilder, parent: &Context) -> Self {
        let span = global::tracer("tracktwin").build_with_context(step, parent);
        Self(parent.with_span(span))
    }

    /// Sets an attribute of the step.
    pub fn tell(&self, key: &'static str, value: impl Into<Value>) {
        self.0.span().set_attribute(KeyValue::new(key, value));
    }

    /// Sets an attribute of the step to a count.
    pub fn count(&self, key: &'static str, count: usize) {
        self.tell(key, i64::try_from(count).unwrap_or(i64::MAX));
    }

    /// Sets the status of the step to failed, with the reason.
    pub fn fail(&self, reason: &str) {
        self.0.span().set_status(Status::error(reason.to_owned()));
    }

    /// The W3C Trace Context of the step, for the steps that follow. If only the previous process
    /// traces, the context is that of the previous step. Empty if nothing is traced.
    pub fn traceparent(&self) -> String {
        let mut headers = HashMap::new();
        TraceContextPropagator::new().inject_context(&self.0, &mut headers);
        headers.remove(TRACEPARENT).unwrap_or_default()
    }
}

fn context(traceparent: &str) -> Context {
    let headers = HashMap::from([(TRACEPARENT.to_owned(), traceparent.to_owned())]);
    TraceContextPropagator::new().extract_with_context(&Context::new(), &headers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_traces_nothing_passes_on_what_it_got() {
        let earlier = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";
        assert_eq!(Step::after("report", [earlier]).traceparent(), earlier);
        assert_eq!(Step::first("lease", SystemTime::now()).traceparent(), "");
        for nonsense in ["", "00-0-0-0", "\u{0}", &"9".repeat(10_000)] {
            assert_eq!(Step::after("report", [nonsense]).traceparent(), "");
            assert_eq!(Step::after("report", [nonsense, earlier]).traceparent(), earlier);
        }
    }
}
