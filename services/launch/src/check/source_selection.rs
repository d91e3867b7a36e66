//! A run with another source, such as a replay: selects the stages that are left out.

use crate::plan::PlannedStage;

/// Leaves out the stages that `source` replaces: the producers of its topics, then stages that lack an input, and
/// stages whose topics have lost all consumers. Returns their names.
pub fn leave_out(stages: &mut Vec<PlannedStage>, source: &str) -> Vec<String> {
    let Some(own) = stages.iter().find(|stage| stage.name == source) else { return Vec::new() };
    let replaced: Vec<String> = own.description.outputs.iter().map(|port| port.topic.clone()).collect();
    let had_consumer: Vec<String> =
        stages.iter().filter(|stage| has_consumer(stage, stages)).map(|stage| stage.name.clone()).collect();
    let mut left_out = Vec::new();
    let mut drop_those = |stages: &mut Vec<PlannedStage>, useless: &dyn Fn(&PlannedStage) -> bool| {
        let before = left_out.len();
        left_out.extend(stages.iter().filter(|s| s.name != source && useless(s)).map(|stage| stage.name.clone()));
        stages.retain(|stage| !left_out.contains(&stage.name));
        left_out.len() > before
    };
    drop_those(stages, &|stage| {
        let ports = &stage.description;
        ports.inputs.is_empty() || ports.outputs.iter().any(|port| replaced.contains(&port.topic))
    });
    loop {
        let those = stages.clone();
        let lacks_input = |stage: &PlannedStage| {
            let there =
                |topic: &String| those.iter().any(|s| s.description.outputs.iter().any(|port| port.topic == *topic));
            let inputs = &stage.description.inputs;
            inputs.iter().any(|port| !port.optional && !there(&port.topic))
                || !inputs.iter().any(|port| there(&port.topic))
        };
        let unread = |stage: &PlannedStage| had_consumer.contains(&stage.name) && !has_consumer(stage, &those);
        if !drop_those(stages, &|stage| lacks_input(stage) || unread(stage)) {
            return left_out;
        }
    }
}

/// Topics that a stage of `stages` reads and that have lost their producer: `before` are the stages of the launch file.
/// In the order of the launch file.
pub fn missing_topics(before: &[PlannedStage], stages: &[PlannedStage]) -> Vec<String> {
    let produced = before.iter().flat_map(|stage| stage.description.outputs.iter().map(|port| port.topic.clone()));
    let mut missing: Vec<String> = Vec::new();
    for topic in produced {
        let reads = |stage: &PlannedStage| stage.description.inputs.iter().any(|port| port.topic == topic);
        let produces = |stage: &PlannedStage| stage.description.outputs.iter().any(|port| port.topic == topic);
        if stages.iter().any(reads) && !stages.iter().any(produces) && !missing.contains(&topic) {
            missing.push(topic);
        }
    }
    missing
}

fn has_consumer(stage: &PlannedStage, stages: &[PlannedStage]) -> bool {
    let outputs = &stage.description.outputs;
    stages.iter().any(|other| {
        other.description.inputs.iter().any(|input| outputs.iter().any(|output| output.topic == input.topic))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::StageTable;
    use messages::{ByteTable, TickTopic};
    use run::assignment::{CONTRACT_VERSION, Description, PortDescription};

    /// `inputs` and `outputs` are topics; a `?` marks an optional one.
    fn stage(name: &str, inputs: &str, outputs: &str) -> PlannedStage {
        let port = |word: &str| {
            let topic = word.trim_end_matches('?').to_owned();
            let table = ByteTable { topic: topic.clone(), ..ByteTable::of::<TickTopic>() };
            let optional = word.ends_with('?');
            PortDescription { topic, version: 1, layout: 7, queue: 2, borrowed: 1, optional, table }
        };
        let ports = |words: &str| words.split_whitespace().map(port).collect();
        PlannedStage {
            name: name.into(),
            span: None,
            program: "".into(),
            table: StageTable::default(),
            remote: None,
            description: Description {
                contract: CONTRACT_VERSION,
                name: name.into(),
                inputs: ports(inputs),
                outputs: ports(outputs),
                settings: vec![],
                files: [].into(),
            },
            files: vec![],
            inputs: vec![],
            outputs: vec![],
        }
    }

    struct Replay {
        /// Stages that it leaves out.
        left_out: String,
        /// Topics that it lacks.
        missing: String,
    }

    fn replay_of(topics: &str) -> Replay {
        let before = vec![
            stage("acquire", "", "sweep image gnss"),
            stage("slam", "sweep gnss?", "submap trajectory placement"),
            stage("colorize", "submap trajectory image?", "color spectra"),
            stage("infer", "submap", "class"),
            stage("export", "submap trajectory placement? color? spectra? class?", ""),
            stage("replay", "", topics),
        ];
        let mut stages = before.clone();
        let left_out = leave_out(&mut stages, "replay");
        Replay { left_out: left_out.join(" "), missing: missing_topics(&before, &stages).join(" ") }
    }

    #[test]
    fn replay_of_all_topics_that_remaining_stages_read_lacks_none() {
        assert_eq!(replay_of("sweep image gnss").missing, "");
        let Replay { left_out, missing } = replay_of("submap trajectory placement color spectra");
        assert_eq!((left_out.as_str(), missing.as_str()), ("acquire slam colorize", ""));
    }

    #[test]
    fn replay_lacks_topics_whose_stage_was_left_out_and_that_others_read() {
        assert_eq!(replay_of("submap trajectory color").missing, "placement spectra");
        assert_eq!(replay_of("submap trajectory placement").missing, "image");
        assert_eq!(replay_of("sweep").missing, "image gnss");
    }
}
