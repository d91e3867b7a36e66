//! The topics of a bag.

use std::collections::BTreeMap;

/// Serialization of messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// Serialization of ROS 1.
    Ros1,
    /// CDR, the serialization of ROS 2.
    Cdr,
}

/// A topic.
#[derive(Clone, Debug)]
pub(crate) struct Topic {
    pub name: String,
    /// Type without the `/msg/` of ROS 2: `sensor_msgs/Imu`.
    pub kind: String,
    /// `None`: an unsupported serialization.
    pub encoding: Option<Encoding>,
    /// Number of messages.
    pub count: u64,
}

/// Topics with different names or types.
#[derive(Clone, Debug, Default)]
pub(super) struct Topics {
    list: Vec<Topic>,
    index: BTreeMap<(String, String), usize>,
}

impl Topics {
    /// Index of the topic, which is added if it is new.
    pub fn add(&mut self, name: &str, kind: &str, encoding: Option<Encoding>) -> usize {
        let kind = kind.replace("/msg/", "/");
        *self.index.entry((name.to_owned(), kind.clone())).or_insert_with(|| {
            self.list.push(Topic { name: name.to_owned(), kind, encoding, count: 0 });
            self.list.len() - 1
        })
    }

    /// Adds a topic of a part with its messages.
    pub fn merge(&mut self, topic: &Topic) -> usize {
        let index = self.add(&topic.name, &topic.kind, topic.encoding);
        self.list[index].count += topic.count;
        index
    }

    /// Counts messages.
    pub fn count(&mut self, topic: usize, n: u64) {
        self.list[topic].count = self.list[topic].count.saturating_add(n);
    }

    pub fn list(&self) -> &[Topic] {
        &self.list
    }
}
