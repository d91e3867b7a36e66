//! The limits of this process that its stages inherit (`ulimit`), and the needs of a run. A stage that reaches a limit
//! fails somewhere within the transport, and no restart helps.

use crate::plan::PlannedStage;
use ipc::Channel;
use rustix::process::{Resource, getrlimit};
use std::collections::BTreeSet;

/// Services of a stage in addition to the services of its topics: command, heartbeat, wake.
const OWN_SERVICES: usize = 3;
/// Files of a process that are not services: log, node, connections to the supervisor.
const OTHER_FILES: usize = 24;
/// Files of an opened service and of the connections through it, counted in halves: 5.0 to 5.9 files were measured in addition
/// to [`OTHER_FILES`].
const HALF_FILES_PER_SERVICE: usize = 11;

/// Address space of a stage's program, data and allocator. Stages of the sample drive use up to 0.4 GiB.
const PRIVATE_BYTES: u64 = 1 << 30;
/// Address space for each core: the C library reserves memory for each thread.
const PRIVATE_BYTES_PER_CORE: u64 = 128 << 20;

/// A limit, and the need of a run.
struct Demand {
    limit: Option<u64>,
    need: u64,
    stage: String,
}

/// A problem for each limit that is too low for these stages.
pub fn lacks(stages: &[PlannedStage]) -> Vec<String> {
    let mut problems = Vec::new();
    let files = Demand::above_limit(stages, Resource::Nofile, |index, stage| files(stages, index, stage));
    if let Some(Demand { limit: Some(limit), need, stage }) = files {
        problems.push(format!(
            "limit of open files: {limit} (ulimit -n), stage {stage} needs {need}; raise it with `ulimit -n {need}`"
        ));
    }
    let n_cores = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let bytes = Demand::above_limit(stages, Resource::As, |_, stage| {
        mapped_bytes(stage) + PRIVATE_BYTES + n_cores * PRIVATE_BYTES_PER_CORE
    });
    if let Some(Demand { limit: Some(limit), need, stage }) = bytes {
        let limit = limit >> 10;
        let need = need.div_ceil(1 << 10);
        problems.push(format!(
            "limit of address space: {limit} KiB (ulimit -v), stage {stage} needs {need} KiB, most of it reserved and never \
             used; remove it with `ulimit -v unlimited`, or limit memory with a control group instead"
        ));
    }
    problems
}

impl Demand {
    /// The largest demand of a stage, if it is above the limit.
    fn above_limit(
        stages: &[PlannedStage],
        resource: Resource,
        need: impl Fn(usize, &PlannedStage) -> u64,
    ) -> Option<Self> {
        let limit = getrlimit(resource).current;
        let needs = stages.iter().enumerate().map(|(index, stage)| (need(index, stage), stage));
        let (need, stage) = needs.max_by_key(|(need, _)| *need)?;
        let exceeds = limit.is_some_and(|limit| need > limit);
        exceeds.then(|| Self { limit, need, stage: stage.name.clone() })
    }
}

/// The channels of a stage: the channels that it reads, and the channels that it writes.
fn channels(stage: &PlannedStage) -> [Vec<&Channel>; 2] {
    [&stage.inputs, &stage.outputs].map(|topics| {
        let both = topics.iter().flat_map(|topic| [&topic.messages, &topic.ticks]);
        both.collect()
    })
}

/// Number of files that the stage has open. It inherits one for each service of the run and for each stage that was
/// started before it.
fn files(stages: &[PlannedStage], index: usize, stage: &PlannedStage) -> u64 {
    let of_topics: usize = stages.iter().flat_map(|stage| channels(stage)[1].clone()).map(Channel::n_services).sum();
    let inherited = of_topics + OWN_SERVICES * (stages.len() + index + 1);
    let [inputs, outputs] = channels(stage);
    let wakes: BTreeSet<&String> = inputs
        .iter()
        .map(|channel| &channel.producer)
        .chain(outputs.iter().flat_map(|channel| &channel.consumers))
        .collect();
    let opened = OWN_SERVICES
        + wakes.len()
        + inputs.len() * Channel::SERVICES_OF_CONSUMER
        + outputs.iter().map(|channel| channel.services_of_producer()).sum::<usize>();
    (inherited + OTHER_FILES + (opened * HALF_FILES_PER_SERVICE).div_ceil(2)) as u64
}

fn mapped_bytes(stage: &PlannedStage) -> u64 {
    channels(stage).concat().into_iter().map(Channel::mapped_bytes).sum()
}
