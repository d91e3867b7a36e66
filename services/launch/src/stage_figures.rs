//! The figures of a stage in a progress event.

use run::health::{Activity, Arrivals, Latency, Traffic};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Figures of one stage.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StageFigures {
    /// Its table.
    pub name: String,
    /// Its current activity.
    pub activity: Activity,
    /// Ticks finished.
    pub ticks: u64,
    /// Points processed.
    pub points: u64,
    /// Drive time behind the foremost stage, s.
    pub lag_s: Option<f64>,
    /// Last barrier whose state is on the disk.
    pub barrier: u64,
    /// Duration of a step.
    pub step: Latency,
    /// Time from the start of a tick at the source to its end here.
    pub age: Latency,
    /// Traffic by input topic.
    pub inputs: BTreeMap<String, Traffic>,
    /// Traffic by output topic.
    pub outputs: BTreeMap<String, Traffic>,
    /// Delivery by input topic.
    pub arrivals: BTreeMap<String, Arrivals>,
    /// Messages that the slowest consumer has not taken yet, by output topic.
    pub waiting: BTreeMap<String, u64>,
    /// User and system time, s.
    pub cpu_s: f64,
    /// Resident memory, bytes.
    pub rss_bytes: u64,
}
