//! The figures that are compared.

use run::summary::{StageSummary, Summary};

/// The better direction of a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// Throughput.
    Higher,
    /// Costs and times.
    Lower,
}

/// A figure of a run or of a stage.
#[derive(Clone, Copy, Debug)]
pub struct Figure {
    /// Name with its unit.
    pub name: &'static str,
    /// The better direction.
    pub better: Better,
    /// Smaller changes are never reported, in the unit of the figure: a few clock ticks of 10 ms, or a few pages.
    pub floor: f64,
}

/// A figure of costs.
const fn cost(name: &'static str, floor: f64) -> Figure {
    Figure { name, better: Better::Lower, floor }
}

/// A figure of the whole run, and its value.
type RunFigure = (Figure, fn(&Summary) -> f64);

/// A figure of a stage, and its value.
type StageFigure = (Figure, fn(&StageSummary) -> f64);

const MEGA: f64 = 1e-6;

/// Figures of the whole run. The largest latency is not compared: one value of a run decides it.
pub const RUN_FIGURES: [RunFigure; 9] = [
    (cost("wall, s", 0.05), |run| run.total.wall_s),
    (Figure { name: "M points/s", better: Better::Higher, floor: 0.0 }, |run| run.total.points_per_s * MEGA),
    (cost("processor, s", 0.05), |run| run.total.cpu_s),
    (cost("processor of the supervisor, s", 0.05), |run| run.total.supervisor_cpu_s),
    (cost("processor of the transport, s", 0.05), Summary::transport_cpu_s),
    (cost("peak shared memory, MB", 1.0), |run| run.total.peak_shared_memory_bytes as f64 * MEGA),
    (cost("peak RSS, sum of stages, MB", 1.0), |run| run.peak_rss_bytes() as f64 * MEGA),
    (cost("age at the sink p50, ms", 1.0), |run| run.total.latency.p50_ms),
    (cost("age at the sink p99, ms", 1.0), |run| run.total.latency.p99_ms),
];

/// Figures of a stage.
pub const STAGE_FIGURES: [StageFigure; 7] = [
    (cost("processor, s", 0.05), |stage| stage.cpu_s),
    (cost("step p50, ms", 1.0), |stage| stage.step.p50_ms),
    (cost("step p99, ms", 1.0), |stage| stage.step.p99_ms),
    (cost("peak private memory, MB", 1.0), |stage| stage.peak_private_bytes as f64 * MEGA),
    (cost("rows received, MB", 0.1), |stage| stage.bytes_in() as f64 * MEGA),
    (cost("read, MB", 0.1), |stage| stage.read_bytes as f64 * MEGA),
    (cost("written, MB", 0.1), |stage| stage.written_bytes as f64 * MEGA),
];
