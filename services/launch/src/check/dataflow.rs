//! The dataflow of a run: producers and consumers of topics, and the order of stages.

use crate::plan::PlannedStage;
use ipc::Channel;
use messages::TickTopic;
use run::Mode;
use run::assignment::{PortDescription, TopicChannels, wake_name};
use settings::Problem;
use std::collections::BTreeMap;
use std::fmt::Write;

/// A problem of a stage.
pub struct StageProblem {
    /// Its table.
    pub stage: String,
    /// The problem.
    pub problem: Problem,
}

/// The producer of a topic.
struct Producer {
    /// Index of the stage.
    stage: usize,
    port: PortDescription,
}

/// Connects the stages by their topics and sorts them in dataflow order.
pub fn connect(stages: &mut Vec<PlannedStage>, mode: Mode) -> Vec<StageProblem> {
    let mut problems = Vec::new();
    let mut report = |stage: &PlannedStage, text: String| {
        let problem = Problem { key: String::new(), span: stage.span.clone(), text };
        problems.push(StageProblem { stage: stage.name.clone(), problem });
    };
    let mut producers: BTreeMap<String, Producer> = BTreeMap::new();
    for (index, stage) in stages.iter().enumerate() {
        for port in &stage.description.outputs {
            if let Some(other) = producers.get(&port.topic) {
                let topic = &port.topic;
                let other = &stages[other.stage].name;
                let hint = format!("give this one another name, e.g. remap = {{ {topic} = \"{topic}_b\" }}");
                report(stage, format!("topic {topic} is already produced by [{other}]; {hint}"));
            } else {
                producers.insert(port.topic.clone(), Producer { stage: index, port: port.clone() });
            }
        }
    }
    let mut consumers: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (index, stage) in stages.iter().enumerate() {
        for port in &stage.description.inputs {
            match producers.get(&port.topic) {
                None if port.optional => {}
                None => report(stage, format!("needs topic {}, which no stage of this file produces", port.topic)),
                Some(Producer { stage: producer, port: output }) => {
                    let producer = &stages[*producer].name;
                    if output.version != port.version {
                        let versions = format!("expects version {} of topic {}", port.version, port.topic);
                        report(stage, format!("{versions}, [{producer}] produces version {}", output.version));
                    } else if (output.queue, output.borrowed) != (port.queue, port.borrowed) {
                        let bounds = format!("expects topic {} with other bounds than [{producer}]", port.topic);
                        let theirs = (output.queue, output.borrowed);
                        let ours = (port.queue, port.borrowed);
                        report(stage, format!("{bounds}: queue and borrowed {ours:?}, not {theirs:?}"));
                    } else if output.layout != port.layout {
                        let layouts = format!("expects layout {:016x} of topic {}", port.layout, port.topic);
                        report(stage, format!("{layouts}, [{producer}] produces {:016x}", output.layout));
                    }
                    consumers.entry(port.topic.clone()).or_default().push(index);
                }
            }
        }
    }
    for (index, stage) in stages.iter().enumerate() {
        let ports = &stage.description.inputs;
        let unread = ports.iter().all(|port| port.optional && !producers.contains_key(&port.topic));
        if !ports.is_empty() && unread {
            let topics: Vec<&str> = ports.iter().map(|port| port.topic.as_str()).collect();
            report(stage, format!("has no input: no stage of this file produces {}", topics.join(" or ")));
        }
        // The source counts the ticks: two sources would have two counts.
        let earlier = stages[..index].iter().find(|earlier| earlier.description.inputs.is_empty());
        if let Some(earlier) = earlier.filter(|_| ports.is_empty()) {
            report(stage, format!("is a second source, after [{}]: a run has one source", earlier.name));
        }
    }
    let edges: Vec<Edge> = consumers
        .iter()
        .flat_map(|(topic, indices)| {
            let producer = producers[topic].stage;
            indices.iter().map(move |consumer| Edge { producer, consumer: *consumer })
        })
        .collect();
    let order = match order(stages.len(), &edges) {
        Ok(order) => order,
        Err(cycle) => {
            let names: Vec<&str> = cycle.iter().map(|index| stages[*index].name.as_str()).collect();
            report(&stages[cycle[0]], format!("is part of a cycle: {}", names.join(", ")));
            return problems;
        }
    };
    let channels: BTreeMap<&String, TopicChannels> = producers
        .iter()
        .map(|(topic, Producer { stage: producer, port })| {
            let consumers = consumers.get(topic).map(Vec::as_slice).unwrap_or_default();
            (topic, channels(port, &stages[*producer].name, consumers.iter().map(|index| &*stages[*index].name), mode))
        })
        .collect();
    let of = |stage: &PlannedStage, ports: &[PortDescription]| {
        let with_port = |channels: &TopicChannels| TopicChannels {
            port: stage.table.remap.port_of(&channels.topic).to_owned(),
            ..channels.clone()
        };
        ports.iter().filter_map(|port| channels.get(&port.topic).map(with_port)).collect()
    };
    let inputs: Vec<Vec<_>> = stages.iter().map(|stage| of(stage, &stage.description.inputs)).collect();
    let outputs: Vec<Vec<_>> = stages.iter().map(|stage| of(stage, &stage.description.outputs)).collect();
    for ((stage, inputs), outputs) in stages.iter_mut().zip(inputs).zip(outputs) {
        stage.inputs = inputs;
        stage.outputs = outputs;
    }
    let mut unordered: Vec<Option<PlannedStage>> = std::mem::take(stages).into_iter().map(Some).collect();
    stages.extend(order.into_iter().filter_map(|index| unordered[index].take()));
    problems
}

fn channels<'a>(
    port: &PortDescription,
    producer: &str,
    consumers: impl Iterator<Item = &'a str>,
    mode: Mode,
) -> TopicChannels {
    let drops_oldest = mode == Mode::Live;
    let producer = wake_name(producer);
    let consumers: Vec<String> = consumers.map(wake_name).collect();
    TopicChannels {
        ticks: Channel {
            drops_oldest,
            ..Channel::new::<TickTopic>(&format!("{}.tick", port.topic), &producer, &consumers)
        },
        messages: Channel {
            name: port.topic.clone(),
            version: port.version,
            layout: port.layout,
            header_bytes: port.table.header_bytes,
            row_bytes: port.table.row_bytes,
            max_rows: port.table.max_rows,
            drops_oldest,
            queue: port.queue,
            borrowed: port.borrowed,
            producer,
            consumers,
        },
        topic: port.topic.clone(),
        port: port.topic.clone(),
    }
}

/// A topic from one stage to another, by their indices.
struct Edge {
    producer: usize,
    consumer: usize,
}

/// Sorts producers before consumers, otherwise in the order of the file. `Err`: the members of cycles.
fn order(n: usize, edges: &[Edge]) -> Result<Vec<usize>, Vec<usize>> {
    let mut done: Vec<usize> = Vec::new();
    while done.len() < n {
        let ready = (0..n).find(|candidate| {
            let is_ready = |edge: &Edge| edge.consumer != *candidate || done.contains(&edge.producer);
            !done.contains(candidate) && edges.iter().all(is_ready)
        });
        match ready {
            Some(next) => done.push(next),
            None => return Err((0..n).filter(|index| !done.contains(index)).collect()),
        }
    }
    Ok(done)
}

/// The dataflow as a Mermaid diagram.
pub fn mermaid(stages: &[PlannedStage]) -> String {
    let mut text = String::from("flowchart LR\n");
    for producer in stages {
        for topic in &producer.outputs {
            for consumer in stages.iter().filter(|s| s.inputs.iter().any(|input| input.topic == topic.topic)) {
                // Writing to a string cannot fail.
                let _ = writeln!(text, "    {} -- {} --> {}", producer.name, topic.topic, consumer.name);
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::StageTable;
    use run::assignment::{CONTRACT_VERSION, Description};

    fn port(topic: &str) -> PortDescription {
        let table = messages::ByteTable { topic: topic.into(), ..messages::ByteTable::of::<TickTopic>() };
        PortDescription { topic: topic.into(), version: 1, layout: 7, queue: 2, borrowed: 1, optional: false, table }
    }

    fn planned(name: &str, inputs: &[PortDescription], outputs: &[PortDescription]) -> PlannedStage {
        let description = Description {
            contract: CONTRACT_VERSION,
            name: name.into(),
            inputs: inputs.to_vec(),
            outputs: outputs.to_vec(),
            settings: vec![],
            files: [].into(),
        };
        let table = StageTable::default();
        PlannedStage {
            name: name.into(),
            span: None,
            program: "".into(),
            table,
            remote: None,
            description,
            files: vec![],
            inputs: vec![],
            outputs: vec![],
        }
    }

    fn texts(stages: &mut Vec<PlannedStage>) -> Vec<String> {
        connect(stages, Mode::Offline)
            .into_iter()
            .map(|StageProblem { stage, problem }| format!("{stage}: {}", problem.text))
            .collect()
    }

    #[test]
    fn stages_are_sorted_in_dataflow_order() {
        let mut stages = vec![
            planned("sink", &[port("b"), PortDescription { optional: true, ..port("z") }], &[]),
            planned("middle", &[port("a")], &[port("b")]),
            planned("source", &[], &[port("a")]),
        ];
        assert_eq!(texts(&mut stages), Vec::<String>::new());
        let names: Vec<&str> = stages.iter().map(|stage| stage.name.as_str()).collect();
        assert_eq!(names, ["source", "middle", "sink"]);
        assert_eq!(stages[1].inputs[0].messages.producer, "source.wake");
        assert_eq!(stages[1].outputs[0].ticks.consumers, ["sink.wake"]);
        assert!(mermaid(&stages).contains("source -- a --> middle"));
        assert_eq!(stages[2].inputs.len(), 1, "an optional input without a producer has no channels");
    }

    #[test]
    fn every_mismatch_is_reported() {
        let mut stages = vec![
            planned("one", &[port("missing")], &[port("a"), port("loop")]),
            planned("two", &[PortDescription { version: 2, ..port("a") }], &[port("a")]),
            planned("three", &[PortDescription { layout: 8, ..port("a") }], &[]),
        ];
        let texts = texts(&mut stages);
        assert_eq!(texts.len(), 4, "{texts:?}");
        assert!(texts[0].starts_with("two: topic a is already produced by [one]"));
        assert!(texts[1].starts_with("one: needs topic missing"));
        assert!(texts[2].starts_with("two: expects version 2"));
        assert!(texts[3].starts_with("three: expects layout"));
    }

    #[test]
    fn run_has_one_source_and_every_other_stage_has_an_input() {
        let idle = PortDescription { optional: true, ..port("nothing") };
        let mut stages =
            vec![planned("one", &[], &[port("a")]), planned("two", &[], &[]), planned("idle", &[idle], &[])];
        let expected = [
            "two: is a second source, after [one]: a run has one source",
            "idle: has no input: no stage of this file produces nothing",
        ];
        assert_eq!(texts(&mut stages), expected);
    }

    #[test]
    fn cycles_are_refused() {
        let mut stages = vec![planned("a", &[port("y")], &[port("x")]), planned("b", &[port("x")], &[port("y")])];
        assert_eq!(texts(&mut stages), ["a: is part of a cycle: a, b"]);
    }
}
