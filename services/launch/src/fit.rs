//! Whether a plan can take over a run in its middle.

use crate::plan::PlannedStage;

/// Why `new` are not the stages of the run of `old` with another `stage`.
///
/// The stage writes the same topics of the same types: who reads them holds messages, or counts on those to come. It may
/// read other topics of this run. All others are what they were.
pub fn misfits(old: &[PlannedStage], new: &[PlannedStage], stage: &str) -> Vec<String> {
    let mut misfits = Vec::new();
    for before in old {
        let name = &before.name;
        let Some(after) = new.iter().find(|after| after.name == *name) else {
            misfits.push(format!("[{name}] is gone from the launch file"));
            continue;
        };
        if name != stage {
            if (&before.program, &before.description) != (&after.program, &after.description) {
                misfits
                    .push(format!("[{name}] says something else of itself than at the start: its program was changed"));
            }
            continue;
        }
        let (was, is) = (&before.description.outputs, &after.description.outputs);
        for port in was {
            match is.iter().find(|other| other.topic == port.topic) {
                None => misfits.push(format!("[{name}] would not write topic {} any more", port.topic)),
                Some(other) if other != port => {
                    misfits.push(format!("[{name}] would write topic {} with another layout or bounds", port.topic));
                }
                Some(_) => {}
            }
        }
        let new_ones = is.iter().filter(|port| was.iter().all(|other| other.topic != port.topic));
        misfits
            .extend(new_ones.map(|port| format!("[{name}] would write topic {}, which this run has not", port.topic)));
    }
    misfits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::StageTable;
    use messages::{ByteTable, Tick};
    use stage::assignment::{CONTRACT_VERSION, Description, PortDescription};

    fn port(topic: &str, layout: u64) -> PortDescription {
        let table = ByteTable::of::<Tick>();
        PortDescription { topic: topic.into(), version: 1, layout, queue: 2, borrowed: 1, optional: false, table }
    }

    fn planned(name: &str, inputs: &[PortDescription], outputs: &[PortDescription]) -> PlannedStage {
        let (inputs, outputs) = (inputs.to_vec(), outputs.to_vec());
        let description =
            Description { contract: CONTRACT_VERSION, name: name.into(), inputs, outputs, settings: vec![] };
        let (program, table) = ("".into(), StageTable::default());
        PlannedStage { name: name.into(), span: None, program, table, description, inputs: vec![], outputs: vec![] }
    }

    #[test]
    fn a_stage_may_read_other_topics_but_must_write_the_same() {
        let source = planned("source", &[], &[port("a", 1), port("b", 1)]);
        let old = [source.clone(), planned("relay", &[port("a", 1)], &[port("c", 1), port("d", 1)])];
        let with = |inputs: &[PortDescription], outputs: &[PortDescription]| {
            misfits(&old, &[planned("relay", inputs, outputs), source.clone()], "relay")
        };
        assert_eq!(with(&[port("b", 1)], &[port("d", 1), port("c", 1)]), Vec::<String>::new());
        let expected = [
            "[relay] would write topic c with another layout or bounds",
            "[relay] would not write topic d any more",
            "[relay] would write topic e, which this run has not",
        ];
        assert_eq!(with(&[port("a", 1)], &[port("e", 1), port("c", 2)]), expected);
    }

    #[test]
    fn all_other_stages_are_what_they_were() {
        let old = [planned("source", &[], &[port("a", 1)]), planned("sink", &[port("a", 1)], &[])];
        let new = [planned("source", &[], &[port("a", 1), port("b", 1)])];
        let misfits = misfits(&old, &new, "sink");
        assert_eq!(misfits.len(), 2, "{misfits:?}");
        assert!(misfits[0].starts_with("[source] says something else of itself"), "{misfits:?}");
        assert_eq!(misfits[1], "[sink] is gone from the launch file");
    }
}
