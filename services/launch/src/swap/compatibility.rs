//! Checks whether a new plan can continue a running pipeline.

use crate::plan::PlannedStage;

/// The reasons why `new` is not `old` with another `stage`.
///
/// The stage must write the same topics with the same types, because its consumers hold messages and expect more. It
/// may read other topics of this run. All other stages must be unchanged.
pub fn incompatibilities(old: &[PlannedStage], new: &[PlannedStage], stage: &str) -> Vec<String> {
    let mut reasons = Vec::new();
    for before in old {
        let name = &before.name;
        let Some(after) = new.iter().find(|after| after.name == *name) else {
            reasons.push(format!("[{name}] is missing from the launch file"));
            continue;
        };
        if name != stage {
            if (&before.program, &before.description) != (&after.program, &after.description) {
                reasons.push(format!(
                    "[{name}] has another description than at the start of the run: its program was replaced"
                ));
            }
            continue;
        }
        let was = &before.description.outputs;
        let is = &after.description.outputs;
        for port in was {
            match is.iter().find(|other| other.topic == port.topic) {
                None => reasons.push(format!("[{name}] would no longer write topic {}", port.topic)),
                Some(other) if other != port => {
                    reasons.push(format!("[{name}] would write topic {} with another layout or bounds", port.topic));
                }
                Some(_) => {}
            }
        }
        let new_ones = is.iter().filter(|port| was.iter().all(|other| other.topic != port.topic));
        reasons.extend(
            new_ones.map(|port| format!("[{name}] would write topic {}, which this run does not have", port.topic)),
        );
    }
    reasons
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::StageTable;
    use messages::{ByteTable, TickTopic};
    use run::assignment::{CONTRACT_VERSION, Description, PortDescription};

    fn port(topic: &str, layout: u64) -> PortDescription {
        let table = ByteTable::of::<TickTopic>();
        PortDescription { topic: topic.into(), version: 1, layout, queue: 2, borrowed: 1, optional: false, table }
    }

    fn planned(name: &str, inputs: &[PortDescription], outputs: &[PortDescription]) -> PlannedStage {
        let inputs = inputs.to_vec();
        let outputs = outputs.to_vec();
        let description = Description {
            contract: CONTRACT_VERSION,
            name: name.into(),
            inputs,
            outputs,
            settings: vec![],
            files: [].into(),
        };
        let program = "".into();
        let table = StageTable::default();
        PlannedStage {
            name: name.into(),
            span: None,
            program,
            table,
            remote: None,
            description,
            files: vec![],
            inputs: vec![],
            outputs: vec![],
        }
    }

    #[test]
    fn swapped_stage_may_read_other_topics_but_must_write_the_same() {
        let source = planned("source", &[], &[port("a", 1), port("b", 1)]);
        let old = [source.clone(), planned("relay", &[port("a", 1)], &[port("c", 1), port("d", 1)])];
        let with = |inputs: &[PortDescription], outputs: &[PortDescription]| {
            incompatibilities(&old, &[planned("relay", inputs, outputs), source.clone()], "relay")
        };
        assert_eq!(with(&[port("b", 1)], &[port("d", 1), port("c", 1)]), Vec::<String>::new());
        let expected = [
            "[relay] would write topic c with another layout or bounds",
            "[relay] would no longer write topic d",
            "[relay] would write topic e, which this run does not have",
        ];
        assert_eq!(with(&[port("a", 1)], &[port("e", 1), port("c", 2)]), expected);
    }

    #[test]
    fn all_other_stages_must_be_unchanged() {
        let old = [planned("source", &[], &[port("a", 1)]), planned("sink", &[port("a", 1)], &[])];
        let new = [planned("source", &[], &[port("a", 1), port("b", 1)])];
        let reasons = incompatibilities(&old, &new, "sink");
        assert_eq!(reasons.len(), 2, "{reasons:?}");
        assert!(reasons[0].starts_with("[source] has another description"), "{reasons:?}");
        assert_eq!(reasons[1], "[sink] is missing from the launch file");
    }
}
