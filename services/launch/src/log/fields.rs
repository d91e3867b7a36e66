//! The fields of an event or of a span as JSON values.

use serde_json::{Map, Value};
use std::fmt::Debug;
use tracing::field::{Field, Visit};

/// Collects fields by name.
#[derive(Default)]
pub struct Fields {
    /// The values.
    pub by_name: Map<String, Value>,
}

impl Fields {
    /// Removes and returns a text.
    pub fn take_text(&mut self, name: &str) -> Option<String> {
        match self.by_name.remove(name)? {
            Value::String(text) => Some(text),
            other => Some(other.to_string()),
        }
    }

    fn add(&mut self, field: &Field, value: Value) {
        self.by_name.insert(field.name().to_owned(), value);
    }
}

impl Visit for Fields {
    fn record_f64(&mut self, field: &Field, value: f64) {
        self.add(field, value.into());
    }
    fn record_i64(&mut self, field: &Field, value: i64) {
        self.add(field, value.into());
    }
    fn record_u64(&mut self, field: &Field, value: u64) {
        self.add(field, value.into());
    }
    fn record_bool(&mut self, field: &Field, value: bool) {
        self.add(field, value.into());
    }
    fn record_str(&mut self, field: &Field, value: &str) {
        self.add(field, value.into());
    }
    /// Lists and objects are recorded as [`super::Json`]; all other values are text.
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        let text = format!("{value:?}");
        let is_structured = field.name() != "message" && text.starts_with(['[', '{']);
        let parsed = if is_structured { serde_json::from_str(&text).ok() } else { None };
        self.add(field, parsed.unwrap_or(Value::String(text)));
    }
}
