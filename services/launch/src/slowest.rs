//! The slowest stage, for which the other stages wait. It is not the stage that lags most: stages that wait for a slow
//! one lag more.

use crate::plan::PlannedStage;
use run::health::{Activity, Health};

/// The topics of each stage, in the order of the dataflow.
pub struct Dataflow(Vec<Topics>);

struct Topics {
    inputs: Vec<String>,
    outputs: Vec<String>,
}

impl Dataflow {
    /// The dataflow of a plan.
    pub fn from_stages(stages: &[PlannedStage]) -> Self {
        let topics = |stage: &PlannedStage| Topics {
            inputs: stage.inputs.iter().map(|topic| topic.topic.clone()).collect(),
            outputs: stage.outputs.iter().map(|topic| topic.topic.clone()).collect(),
        };
        Self(stages.iter().map(topics).collect())
    }

    /// Index of the stage that the other stages wait for, from their heartbeats in the order of the dataflow. Starts at
    /// the stage that lags most and follows what each stage waits for. `None` when all have finished.
    pub fn slowest(&self, stages: &[&Health]) -> Option<usize> {
        let is_busy = |index: &usize| !matches!(stages[*index].activity, Activity::Draining | Activity::Done);
        let all = || (0..stages.len().min(self.0.len())).filter(is_busy);
        // Among several that lag equally, take the last of the dataflow: it finishes last.
        let mut found = all().rev().min_by_key(|index| stages[*index].drive_time)?;
        // The search ends at a stage that no other stage waits for, at a stage that waits for nothing, or in a cycle.
        for _ in 0..stages.len() {
            let next = match &stages[found].activity {
                Activity::Waiting(topic) => all().find(|index| self.0[*index].outputs.contains(topic)),
                Activity::Blocked(topic) => all()
                    .filter(|index| self.0[*index].inputs.contains(topic))
                    .min_by_key(|index| stages[*index].drive_time),
                _ => None,
            };
            match next {
                Some(next) if next != found => found = next,
                _ => break,
            }
        }
        Some(found)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// source -> odometry -> network -> sink; the sink also reads odometry.
    fn dataflow() -> Dataflow {
        let topics = |inputs: &[&str], outputs: &[&str]| Topics {
            inputs: inputs.iter().map(|topic| (*topic).to_owned()).collect(),
            outputs: outputs.iter().map(|topic| (*topic).to_owned()).collect(),
        };
        Dataflow(vec![
            topics(&[], &["sweep"]),
            topics(&["sweep"], &["submap"]),
            topics(&["submap"], &["class"]),
            topics(&["submap", "class"], &[]),
        ])
    }

    fn slowest(stages: [(Activity, i64); 4]) -> Option<usize> {
        let health = stages.map(|(activity, time)| Health { activity, drive_time: Some(time), ..Health::default() });
        dataflow().slowest(&health.iter().collect::<Vec<_>>())
    }

    fn waiting(topic: &str) -> Activity {
        Activity::Waiting(topic.to_owned())
    }

    fn blocked(topic: &str) -> Activity {
        Activity::Blocked(topic.to_owned())
    }

    #[test]
    fn working_network_is_slowest_although_the_sink_is_further_behind() {
        let sources = [(blocked("sweep"), 90), (blocked("submap"), 80)];
        let [source, odometry] = sources;
        assert_eq!(slowest([source, odometry, (Activity::Working, 50), (waiting("class"), 40)]), Some(2));
    }

    #[test]
    fn finished_source_is_not_slowest() {
        let done = || (Activity::Done, 100);
        assert_eq!(slowest([done(), done(), (Activity::Working, 100), (waiting("class"), 100)]), Some(2));
        assert_eq!(slowest([done(), done(), done(), (Activity::Working, 100)]), Some(3));
        assert_eq!(slowest([done(), done(), done(), done()]), None);
    }

    #[test]
    fn source_is_slowest_if_all_wait_for_it() {
        let stages = [(Activity::Working, 10), (waiting("sweep"), 9), (waiting("submap"), 9), (waiting("submap"), 9)];
        assert_eq!(slowest(stages), Some(0));
    }

    #[test]
    fn stages_that_wait_for_each_other_end_the_search() {
        let stages = [(Activity::Done, 10), (blocked("submap"), 9), (waiting("submap"), 9), (waiting("submap"), 8)];
        assert!(slowest(stages).is_some());
    }
}
