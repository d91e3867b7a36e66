//! The command line.

use crate::roles::Role;
use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;

/// Take sensors of a running ROS 2 into a live run.
///
/// Subscribes to the topics of the sensors that have a target. Images become files that are named by their stamps, below the folder that
/// acquire watches; samples of an IMU, NMEA sentences and packets of LiDARs are sent by UDP. Nothing of ROS needs to be installed.
/// Ends at Ctrl-C.
#[derive(Parser, Debug)]
#[command(
    name = "replica-ros2",
    version,
    after_help = "Exit codes: 0 Ctrl-C, 1 failed, 2 wrong usage, 3 Ctrl-C after messages were lost or left out"
)]
pub struct Args {
    /// Domain of ROS 2, 0 to 232
    #[arg(long, env = "ROS_DOMAIN_ID", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=232))]
    pub domain: u16,
    /// Folder of all cameras: acquire.cameras
    #[arg(long, value_name = "FOLDER")]
    pub cameras: Option<PathBuf>,
    /// Receiver of samples of the IMU: acquire.imu
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    pub imu: Option<SocketAddr>,
    /// Receiver of NMEA sentences: acquire.gnss
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    pub nmea: Option<SocketAddr>,
    /// Receiver of packets: acquire.listen; once for each LiDAR
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    pub lidar: Vec<SocketAddr>,
    /// Topic of a sensor; it may appear later
    ///
    /// ROLE is camera.K (folder camera/K), mosaic.NAME (folder NAME, samples as PGM), imu, gnss (positions), nmea (sentences), lidar, or
    /// lidar.1 and so on. Sensors that are not named are chosen by type when the first topic is there. If any camera is named, only
    /// the named ones are taken.
    #[arg(long = "topic", value_name = "ROLE=TOPIC", value_parser = Role::parse_wish)]
    pub topics: Vec<(Role, String)>,
    /// Time for the discovery of topics before the choice by type, s
    #[arg(long, value_name = "S", default_value_t = 5.0, value_parser = seconds)]
    pub discover: f64,
    /// Never ask a publisher to resend lost messages
    ///
    /// By default, messages of a reliable publisher are received reliably, and other messages with best effort.
    #[arg(long)]
    pub best_effort: bool,
}

impl Args {
    /// Whether the data of a role have a target.
    pub fn has_target(&self, role: &Role) -> bool {
        match role {
            Role::Camera(_) | Role::Mosaic(_) => self.cameras.is_some(),
            Role::Imu => self.imu.is_some(),
            Role::Gnss | Role::Nmea => self.nmea.is_some(),
            Role::Lidar(index) => *index < self.lidar.len(),
        }
    }

    /// Reads the arguments of the process. Wrong ones end it with exit code 2.
    pub fn read() -> Self {
        let args = Self::parse();
        if let Err(rule) = args.check() {
            Self::command().error(ErrorKind::ValueValidation, rule).exit()
        }
        args
    }

    fn check(&self) -> Result<(), String> {
        if self.cameras.is_none() && self.imu.is_none() && self.nmea.is_none() && self.lidar.is_empty() {
            return Err("no target: set at least one of --cameras, --imu, --nmea and --lidar".into());
        }
        for (index, (role, topic)) in self.topics.iter().enumerate() {
            if !self.has_target(role) {
                let option = role.option();
                return Err(format!("--topic {role}={topic} needs the target {option}, one for each sensor"));
            }
            if self.topics[..index].iter().any(|(other, before)| other == role || before == topic) {
                return Err(format!("--topic {role}={topic}: the role or the topic is given twice"));
            }
        }
        let wishes = |role| self.topics.iter().any(|(wished, _)| *wished == role);
        if wishes(Role::Gnss) && wishes(Role::Nmea) {
            return Err("--topic gnss and --topic nmea belong to one receiver; name one of them".into());
        }
        for index in 1..self.lidar.len() {
            if !wishes(Role::Lidar(index)) {
                return Err(format!("--lidar is given {} times; name --topic lidar.{index}=TOPIC", self.lidar.len()));
            }
        }
        Ok(())
    }
}

#[derive(Debug, thiserror::Error)]
enum ArgumentError {
    #[error("{0}; must be HOST:PORT")]
    Unresolved(#[from] std::io::Error),
    #[error("the host has no IPv4 address")]
    NoIpv4,
    #[error("must be 0 to 3600")]
    Seconds,
}

fn address(text: &str) -> Result<SocketAddr, ArgumentError> {
    text.to_socket_addrs()?.find(SocketAddr::is_ipv4).ok_or(ArgumentError::NoIpv4)
}

fn seconds(text: &str) -> Result<f64, ArgumentError> {
    text.parse().ok().filter(|seconds| (0.0..=3600.0).contains(seconds)).ok_or(ArgumentError::Seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(args: &[&str]) -> String {
        let args = Args::try_parse_from([&["x"], args].concat()).expect("parses");
        args.check().expect_err("is refused")
    }

    #[test]
    fn arguments_that_lead_nowhere_are_refused() {
        assert!(rule(&[]).starts_with("no target"));
        let imu = ["--imu", "127.0.0.1:1"];
        let wish = |wish: &'static str| [&imu[..], &["--topic", wish]].concat();
        assert!(rule(&wish("nmea=/n")).contains("needs the target --nmea"));
        assert!(rule(&wish("lidar.1=/n")).contains("needs the target --lidar"));
        assert!(rule(&[wish("imu=/a"), wish("imu=/b")[2..].to_vec()].concat()).contains("given twice"));
        let lidars = ["--lidar", "127.0.0.1:1", "--lidar", "127.0.0.1:2"];
        assert!(rule(&lidars).contains("name --topic lidar.1=TOPIC"));
        for seconds in ["-1", "nan", "4000"] {
            assert!(Args::try_parse_from(["x", "--discover", seconds]).is_err(), "{seconds}");
        }
    }

    #[test]
    fn definition_of_every_argument_is_consistent_and_short() {
        Args::command().debug_assert();
        for argument in Args::command().get_arguments() {
            let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
            assert!((1..=66).contains(&help.len()), "{}: {help:?}", argument.get_id());
        }
    }
}
