//! The inputs of colorize, read from a recording.

use geometry::{Stamp, Trajectory};
use messages::{CubeTopic, ImageTopic, Message, SubmapTopic};
use recording::TickReader;
use stage::Received;
use std::error::Error;
use std::path::Path;

/// All messages of a run, in order.
#[derive(Default)]
pub struct Recorded {
    /// Submaps, in the order of the run.
    pub submaps: Vec<Received<SubmapTopic>>,
    /// Images, in the order of the run.
    pub images: Vec<Received<ImageTopic>>,
    /// Cubes; empty if not requested.
    pub cubes: Vec<Received<CubeTopic>>,
    /// `odom_from_body` as the run estimated it.
    pub trajectory: Trajectory,
}

impl Recorded {
    /// Reads a recording with the topics submap, trajectory and image, and cube if `with_cubes`.
    pub fn open(path: &Path, with_cubes: bool) -> Result<Self, Box<dyn Error>> {
        let mut recorded = Self::default();
        let topics = ["submap", "trajectory", "image", "cube"];
        let mut reader = TickReader::open(path, if with_cubes { &topics } else { &topics[..3] })?;
        while let Some(tick) = reader.next()? {
            let bytes = |topic: usize| tick.messages.get(topic).into_iter().flatten().map(|message| &message.bytes[..]);
            add(&mut recorded.submaps, bytes(0))?;
            add(&mut recorded.images, bytes(2))?;
            add(&mut recorded.cubes, bytes(3))?;
            for bytes in bytes(1) {
                for row in Received::<messages::TrajectoryTopic>::from_bytes(bytes)?.rows() {
                    let pose = row
                        .odom_from_body
                        .to_pose()
                        .ok_or_else(|| format!("trajectory: {row:?} is not a valid pose"))?;
                    recorded.trajectory.push(Stamp(row.stamp), pose);
                }
            }
        }
        Ok(recorded)
    }
}

fn add<'a, T: Message>(
    to: &mut Vec<Received<T>>,
    messages: impl Iterator<Item = &'a [u8]>,
) -> Result<(), Box<dyn Error>> {
    for bytes in messages {
        to.push(Received::from_bytes(bytes)?);
    }
    Ok(())
}
