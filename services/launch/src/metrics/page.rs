//! Prometheus' text exposition format, version 0.0.4.

use run::health::Latency;
use std::fmt::{Display, Write as _};

/// A page in the format.
#[derive(Default)]
pub struct Page {
    /// The text so far.
    pub text: String,
    family: &'static str,
}

impl Page {
    /// Starts a family of samples.
    pub fn family(&mut self, name: &'static str, kind: &str, help: &str) {
        self.family = name;
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "# HELP {name} {help}\n# TYPE {name} {kind}");
    }

    /// Adds a sample of the family.
    pub fn sample(&mut self, suffix: &str, labels: &[(&str, &str)], value: impl Display) {
        let labels: Vec<String> = labels.iter().map(|(name, value)| format!("{name}=\"{}\"", escaped(value))).collect();
        let labels = if labels.is_empty() { String::new() } else { format!("{{{}}}", labels.join(",")) };
        let _ = writeln!(self.text, "{}{suffix}{labels} {value}", self.family);
    }

    /// Adds quantiles, sum and count, s.
    pub fn summary(&mut self, labels: &[(&str, &str)], latency: &Latency) {
        for (quantile, ms) in [("0.5", latency.p50_ms), ("0.99", latency.p99_ms), ("1", latency.max_ms)] {
            self.sample("", &[labels, &[("quantile", quantile)]].concat(), ms * 1e-3);
        }
        self.sample("_sum", labels, latency.mean_ms * latency.count as f64 * 1e-3);
        self.sample("_count", labels, latency.count);
    }
}

fn escaped(value: &str) -> String {
    value.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}
