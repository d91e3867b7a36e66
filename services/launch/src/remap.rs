//! The key `remap` of a stage's table: maps the program's own topics to topics of the run. With it, two stages run one
//! program, each with its own topics.

use run::Context;
use run::assignment::{Description, PortDescription};
use serde::{Deserialize, Serialize};
use settings::Rule;
use std::collections::BTreeMap;

/// The program's names of topics, each with its names in the run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Remap(BTreeMap<String, Names>);

/// One topic, or several topics that are merged in one input.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "must be a table of topics, each with a topic or a list of topics")]
enum Names {
    One(String),
    Several(Vec<String>),
}

impl Names {
    fn all(&self) -> &[String] {
        match self {
            Self::One(name) => std::slice::from_ref(name),
            Self::Several(names) => names,
        }
    }
}

impl Remap {
    /// Applies the names of the run to the description. A remapped input is required, because it was requested by name.
    /// Returns the problems.
    pub fn apply(&self, description: &mut Description) -> Vec<String> {
        let mut faults = Vec::new();
        let known: Vec<&str> =
            description.inputs.iter().chain(&description.outputs).map(|port| port.topic.as_str()).collect();
        for own in self.0.keys().filter(|own| !known.contains(&own.as_str())) {
            faults.push(format!("the program has no topic {own}; its topics are {}", known.join(", ")));
        }
        for output in &description.outputs {
            if self.0.get(&output.topic).is_some_and(|names| names.all().len() > 1) {
                faults.push(format!("{} is an output: it must have one name", output.topic));
            }
        }
        for ports in [&mut description.inputs, &mut description.outputs] {
            *ports = ports.iter().flat_map(|port| self.renamed(port)).collect();
            for (i, port) in ports.iter().enumerate() {
                if ports[..i].iter().any(|earlier| earlier.topic == port.topic) {
                    faults.push(format!("topic {} stands for two topics of the program", port.topic));
                }
            }
        }
        faults
    }

    fn renamed(&self, port: &PortDescription) -> Vec<PortDescription> {
        let Some(names) = self.0.get(&port.topic) else { return vec![port.clone()] };
        let named = |name: &String| {
            let mut port = PortDescription { topic: name.clone(), optional: false, ..port.clone() };
            port.table.topic.clone_from(name);
            port
        };
        names.all().iter().map(named).collect()
    }

    /// The program's name of a topic of the run.
    pub fn port_of<'a>(&'a self, topic: &'a str) -> &'a str {
        let found = self.0.iter().find(|(_, names)| names.all().iter().any(|name| name == topic));
        found.map_or(topic, |(own, _)| own)
    }

    /// The context in the program's names.
    pub fn context(&self, context: &Context) -> Context {
        let is_connected = |topic: &String| context.connected.contains(topic);
        let mut connected = context.connected.clone();
        connected.retain(|topic| !self.0.contains_key(topic));
        connected.extend(
            self.0.iter().filter(|(_, names)| names.all().iter().any(is_connected)).map(|(own, _)| own.clone()),
        );
        Context { connected, ..context.clone() }
    }
}

/// Names of topics in the form of stage names; an input has at least one.
pub struct PlainNames;

impl Rule<Remap> for PlainNames {
    fn allows(&self, remap: &Remap) -> bool {
        let is_plain = |name: &String| {
            let is_plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_';
            !name.is_empty() && name.bytes().all(is_plain)
        };
        remap.0.values().map(Names::all).all(|names| !names.is_empty() && names.iter().all(is_plain))
    }
    fn text(&self) -> String {
        "must have names of lower-case letters, digits and _".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::{ByteTable, TickTopic};
    use run::Mode;
    use run::assignment::CONTRACT_VERSION;
    use settings::toml::from_str;

    fn port(topic: &str) -> PortDescription {
        let table = ByteTable { topic: topic.into(), ..ByteTable::of::<TickTopic>() };
        PortDescription { topic: topic.into(), version: 1, layout: 7, queue: 2, borrowed: 1, optional: true, table }
    }

    fn description(inputs: &[&str], outputs: &[&str]) -> Description {
        let ports = |topics: &[&str]| topics.iter().map(|topic| port(topic)).collect();
        let inputs = ports(inputs);
        let outputs = ports(outputs);
        Description {
            contract: CONTRACT_VERSION,
            name: "stage".into(),
            inputs,
            outputs,
            settings: Vec::new(),
            files: BTreeMap::new(),
        }
    }

    fn remap(text: &str) -> Remap {
        from_str(text).expect("a remap")
    }

    #[test]
    fn ports_get_the_names_of_the_run_and_keep_their_order() {
        let remap = remap("cube = [\"cube_b\", \"cube_a\"]\ncolor = \"color_b\"");
        let mut description = description(&["submap", "cube"], &["color"]);
        assert_eq!(remap.apply(&mut description), Vec::<String>::new());
        let names = |ports: &[PortDescription]| {
            ports.iter().map(|port| (port.topic.clone(), port.table.topic.clone(), port.optional)).collect::<Vec<_>>()
        };
        let both = |name: &str, optional| (name.to_owned(), name.to_owned(), optional);
        let expected = [both("submap", true), both("cube_b", false), both("cube_a", false)];
        assert_eq!(names(&description.inputs), expected);
        assert_eq!(names(&description.outputs), [both("color_b", false)]);
        assert_eq!(["submap", "cube_a", "color_b"].map(|topic| remap.port_of(topic)), ["submap", "cube", "color"]);
    }

    #[test]
    fn every_fault_is_reported() {
        let faults = |text: &str| remap(text).apply(&mut description(&["submap", "cube"], &["color"]));
        assert_eq!(faults("clas = \"x\""), ["the program has no topic clas; its topics are submap, cube, color"]);
        assert_eq!(faults("color = [\"x\", \"y\"]"), ["color is an output: it must have one name"]);
        assert_eq!(faults("cube = \"submap\""), ["topic submap stands for two topics of the program"]);
        for refused in ["cube = []", "cube = \"Cube\"", "cube = \"cube.tick\"", "cube = \"\""] {
            assert!(!PlainNames.allows(&remap(refused)), "{refused}");
        }
    }

    #[test]
    fn context_has_the_names_of_the_program() {
        let context = Context {
            drive: "".into(),
            output: "".into(),
            launch_folder: "".into(),
            mode: Mode::Offline,
            connected: ["submap", "class", "class_b"].map(str::to_owned).into(),
            missing: vec![],
        };
        let connected = |text: &str| remap(text).context(&context).connected.join(" ");
        assert_eq!(connected("class = \"class_b\""), "submap class_b class");
        assert_eq!(connected("class = \"class_x\""), "submap class_b");
        assert_eq!(connected(""), "submap class class_b");
    }
}
