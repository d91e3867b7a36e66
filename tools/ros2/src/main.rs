//! `replica-ros2`: takes images, samples, positions and packets from a running ROS 2 into a live run.
//!
//! It subscribes by DDS, without an installation of ROS. Images become files that are named by their stamps, in the folders that
//! `acquire` watches; samples of an IMU, sentences and packets of LiDARs are sent to its ports by UDP. `acquire` then treats them as it
//! treats sensors without ROS.
//!
//! It must never change a measurement: bytes of compressed images and of packets stay as they are. Messages that are lost or left out are
//! counted, and the exit code reports them. Clouds are refused, because a cloud has lost the times and returns of its packets.
//!
//! Start reading at `bridge` (finds topics, runs the subscriptions), then `choice` (a topic for each sensor) and `sinks`
//! (targets of messages).

mod arguments;
mod bridge;
mod choice;
mod counts;
mod feed;
mod names;
mod roles;
mod sinks;
mod subscription;

use arguments::Args;
use std::process::ExitCode;

/// Exit code of a bridge that left out messages.
const INCOMPLETE: u8 = 3;

fn main() -> ExitCode {
    match bridge::run(&Args::read()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(INCOMPLETE),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
