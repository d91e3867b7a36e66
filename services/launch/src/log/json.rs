//! Events as JSON lines: `timestamp`, `level`, `kind`, `message`, the event's fields, and the fields of its spans.

use super::fields::Fields;
use super::write_stderr;
use serde_json::{Map, Value};
use tracing::span::{Attributes, Id};
use tracing::{Event, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};
use tracing_subscriber::layer::Context;
use tracing_subscriber::registry::LookupSpan;

/// Writes a JSON object per event to stderr.
pub struct JsonLayer;

impl<S: Subscriber + for<'a> LookupSpan<'a>> Layer<S> for JsonLayer {
    fn on_new_span(&self, attributes: &Attributes<'_>, id: &Id, context: Context<'_, S>) {
        let mut fields = Fields::default();
        attributes.record(&mut fields);
        if let Some(span) = context.span(id) {
            span.extensions_mut().insert(fields);
        }
    }

    fn on_event(&self, event: &Event<'_>, context: Context<'_, S>) {
        let mut fields = Fields::default();
        event.record(&mut fields);
        let mut line = Map::new();
        line.insert("timestamp".to_owned(), timestamp().into());
        line.insert("level".to_owned(), event.metadata().level().as_str().into());
        line.insert("kind".to_owned(), fields.take_text("kind").unwrap_or_else(|| "message".to_owned()).into());
        line.insert("message".to_owned(), fields.take_text("message").unwrap_or_default().into());
        line.extend(fields.by_name);
        for span in context.event_scope(event).into_iter().flatten() {
            if let Some(Fields { by_name: fields }) = span.extensions().get() {
                for (name, value) in fields {
                    line.entry(name.as_str()).or_insert_with(|| value.clone());
                }
            }
        }
        write_stderr(&(Value::Object(line).to_string() + "\n"));
    }
}

/// The current time, in the format of the stages' logs: RFC 3339 in UTC.
fn timestamp() -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = SystemTime.format_time(&mut Writer::new(&mut text));
    text
}
