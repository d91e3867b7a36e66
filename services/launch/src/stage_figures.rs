//! The figures of a stage in a progress event.

use run::health::{Activity, Arrivals, Latency, Traffic};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Figures of one stage.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StageFigures {
    /// Its table.
    pub name: String,
    /// What it does.
    pub activity: Activity,
    /// Ticks finished.
    pub ticks: u64,
    /// Points that passed.
    pub points: u64,
    /// Drive time behind the foremost stage, s.
    pub lag_s: Option<f64>,
    /// Last barrier whose state is on the disk.
    pub barrier: u64,
    /// Time in a step.
    pub step: Latency,
    /// From the source's start of a tick to its end here.
    pub age: Latency,
    /// By input topic.
    pub inputs: BTreeMap<String, Traffic>,
    /// By output topic.
    pub outputs: BTreeMap<String, Traffic>,
    /// By input topic.
    pub arrivals: BTreeMap<String, Arrivals>,
    /// By output topic: messages that its slowest consumer has not taken yet.
    pub waiting: BTreeMap<String, u64>,
    /// User and system time, s.
    pub cpu_s: f64,
    /// Resident memory, bytes.
    pub rss_bytes: u64,
}
