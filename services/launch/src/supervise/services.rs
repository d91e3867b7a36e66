//! The IPC services of an attempt. The supervisor creates them; the stages only open them.

use crate::plan::PlannedStage;
use ipc::{IpcError, Node, ServiceHandles};
use run::assignment::wake_name;

/// Creates all services; they exist as long as the returned value.
pub fn create(node: &Node, stages: &[PlannedStage]) -> Result<ServiceHandles, IpcError> {
    let mut services = ServiceHandles::default();
    for stage in stages {
        for topic in &stage.outputs {
            services.create_channel(node, &topic.messages)?;
            services.create_channel(node, &topic.ticks)?;
        }
        services.create_latest(node, &format!("{}.control", stage.name))?;
        services.create_latest(node, &format!("{}.health", stage.name))?;
        services.create_wake(node, &wake_name(&stage.name), n_wakers(stage))?;
    }
    Ok(services)
}

/// Number of processes that may wake a stage: twice for each topic, for messages and for ticks, the consumers, the
/// producer and the lossless observer that a topic may have; and the supervisor.
fn n_wakers(stage: &PlannedStage) -> usize {
    let n_consumers: usize = stage.outputs.iter().map(|topic| topic.messages.consumers.len()).sum();
    2 * (n_consumers + stage.inputs.len() + stage.outputs.len()) + 1
}
