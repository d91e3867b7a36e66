//! What the supervisor says, as lines for people or as JSON lines for programs.

use serde_json::{Map, Value};
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::time::{FormatTime, SystemTime};

/// How the supervisor and the stages' logs speak.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Log {
    /// Lines for people
    #[default]
    Text,
    /// A JSON object per line
    Json,
}

/// An event as a JSON line: `timestamp`, `kind`, `message`, and what else belongs to it.
pub fn json_line(kind: &str, message: &str, fields: Value) -> String {
    let mut line = Map::new();
    line.insert("timestamp".to_owned(), timestamp().into());
    line.insert("kind".to_owned(), kind.into());
    line.insert("message".to_owned(), message.into());
    if let Value::Object(fields) = fields {
        line.extend(fields);
    }
    Value::Object(line).to_string() + "\n"
}

/// Now, as the stages' logs write it: RFC 3339 in UTC.
fn timestamp() -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = SystemTime.format_time(&mut Writer::new(&mut text));
    text
}

/// A line of a stage's log: an object if the log is JSON.
pub fn log_line(line: &str) -> Value {
    serde_json::from_str(line).ok().filter(Value::is_object).unwrap_or_else(|| line.into())
}
