//! The three stages without processes and without faults.

use misbehaving::{Relay, Sink, Source};
use stage::Flow;
use stage::messages::{ClassTopic, SweepTopic};
use stage::testing::{Bench, context};

#[test]
fn sink_writes_every_message() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = context(folder.path());
    let table = toml("ticks = 3\npoints = 5");
    let (settings, problems) = stage::parse_table(table.get_ref());
    assert!(problems.is_empty());
    let mut source = Bench::<Source>::new(&settings, &context).expect("builds");
    let mut relay = Bench::<Relay>::new(&misbehaving::RelaySettings::default(), &context).expect("builds");
    let mut sink = Bench::<Sink>::new(&misbehaving::SinkSettings::default(), &context).expect("builds");
    loop {
        let flow = source.tick().expect("steps");
        for sweep in source.take::<SweepTopic>() {
            let copy = stage::Received::<SweepTopic>::from_bytes(&sweep.to_bytes()).expect("whole");
            relay.forward(copy);
            sink.forward(sweep);
        }
        relay.tick().expect("steps");
        relay.take::<ClassTopic>().into_iter().for_each(|class| sink.forward(class));
        sink.tick().expect("steps");
        if flow == Flow::End {
            break;
        }
    }
    sink.finish().expect("writes");
    let text = std::fs::read_to_string(folder.path().join("sink.txt")).expect("written");
    let heads: Vec<&str> = text.lines().map(|line| line.rsplit_once(' ').expect("three words").0).collect();
    assert_eq!(heads, ["sweep 0", "class 0", "sweep 1", "class 1", "sweep 2", "class 2"]);
}

fn toml(text: &'static str) -> stage::toml::Spanned<stage::toml::de::DeTable<'static>> {
    stage::toml::de::DeTable::parse(text).expect("parses")
}
