//! Output of the supervisor's events. Events are `tracing` events; a terminal and JSON lines are two subscribers of the
//! same events.
//!
//! Every event has a message for people. For programs it has the field `kind` and further fields; a list or an object is
//! recorded as `%Json(&value)`. Events belong to the spans `run`, `attempt` and `stage`.
//!
//! | kind | fields |
//! |---|---|
//! | `problem` | a problem of the launch file |
//! | `note` | `stage`, `note`: a report of a stage to the operator |
//! | `progress` | `share` (0 to 1), `slowest` (stage that the other stages wait for), `stages`: figures of each stage |
//! | `fault` | `stage`, `fault`, `fault_kind`, `last_log_lines`, `log` |
//! | `restart` | `restart`, `allowed`, `barrier`, `delay_s` |
//! | `done` | `outcome`, `total` |
//! | `message` | all others |

mod fields;
mod json;
mod terminal;

use serde::Serialize;
use std::fmt;
use std::io::{IsTerminal, Write as _};
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

/// Format of the supervisor's events on stderr and of the stages' logs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum LogFormat {
    /// Lines for people
    #[default]
    Text,
    /// A JSON object per line
    Json,
}

impl LogFormat {
    /// Shows all further events of this process.
    pub fn install(self) {
        let registry = tracing_subscriber::registry();
        // A second call changes nothing.
        let _ = match self {
            Self::Text => registry.with(terminal::TerminalLayer::new(self.is_live_table())).try_init(),
            Self::Json => registry.with(json::JsonLayer).try_init(),
        };
    }

    /// Whether progress is a table that is redrawn in place.
    pub fn is_live_table(self) -> bool {
        self == Self::Text && std::io::stderr().is_terminal()
    }
}

/// A field that is a list or an object.
pub struct Json<'a, T>(pub &'a T);

impl<T: Serialize> fmt::Display for Json<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&serde_json::to_string(self.0).map_err(|_unserializable| fmt::Error)?)
    }
}

/// Writes to stderr. A closed terminal shows nothing; the run continues.
fn write_stderr(text: &str) {
    let mut stderr = std::io::stderr().lock();
    let _ = stderr.write_all(text.as_bytes()).and_then(|()| stderr.flush());
}
