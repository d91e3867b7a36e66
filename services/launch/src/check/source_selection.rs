//! A run with another source, such as a replay: which stages are left out.

use crate::plan::PlannedStage;

/// Leaves out the stages that `source` replaces: those that produce one of its topics, then those that lack an input, and
/// those whose topics had a consumer and now have none. Returns their names.
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

fn has_consumer(stage: &PlannedStage, stages: &[PlannedStage]) -> bool {
    let outputs = &stage.description.outputs;
    stages.iter().any(|other| {
        other.description.inputs.iter().any(|input| outputs.iter().any(|output| output.topic == input.topic))
    })
}
