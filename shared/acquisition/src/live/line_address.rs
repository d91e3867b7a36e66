//! Sources of text lines: UDP packets or a serial port.

use rustix::fs::{Mode, OFlags};
use rustix::termios::{ControlModes, OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};
use std::fs::File;
use std::io;
use std::net::{SocketAddrV4, UdpSocket};
use std::path::PathBuf;
use std::str::FromStr;

/// Baud rate without `?baud=`.
const BAUD: u32 = 115_200;

/// Address of a source of lines: `udp://ADDRESS:PORT` or `serial:///dev/ttyUSB0?baud=115200`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LineAddress {
    /// Packets with one or more lines each, from any sender.
    Udp(SocketAddrV4),
    /// A serial port: 8 bits, no parity, one stop bit.
    Serial {
        /// The device.
        device: PathBuf,
        /// Bits per second.
        baud: u32,
    },
}

/// A text that is not a [`LineAddress`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("value {0:?} must be udp://ADDRESS:PORT with an IPv4 address, or serial:///DEVICE?baud=RATE")]
pub struct LineAddressError(String);

impl FromStr for LineAddress {
    type Err = LineAddressError;

    fn from_str(text: &str) -> Result<Self, LineAddressError> {
        let fault = || LineAddressError(text.to_owned());
        if let Some(address) = text.strip_prefix("udp://") {
            return address.parse().map(Self::Udp).map_err(|_| fault());
        }
        let rest = text.strip_prefix("serial://").filter(|rest| rest.starts_with('/')).ok_or_else(fault)?;
        let (device, baud) = match rest.split_once('?') {
            None => (rest, BAUD),
            Some((device, query)) => {
                let baud = query.strip_prefix("baud=").and_then(|baud| baud.parse().ok()).filter(|baud| *baud > 0);
                (device, baud.ok_or_else(fault)?)
            }
        };
        Ok(Self::Serial { device: device.into(), baud })
    }
}

/// An open [`LineAddress`]; reading never blocks.
#[derive(Debug)]
pub(super) enum Link {
    Udp(UdpSocket),
    Serial(File),
}

impl LineAddress {
    /// Opens the socket or the port. The error does not name it.
    pub(super) fn open(&self) -> io::Result<Link> {
        match self {
            Self::Udp(address) => {
                let socket = UdpSocket::bind(address)?;
                socket.set_nonblocking(true)?;
                Ok(Link::Udp(socket))
            }
            Self::Serial { device, baud } => {
                let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
                let port = rustix::fs::open(device, flags, Mode::empty())?;
                let mut termios = tcgetattr(&port)?;
                // No echo and no changed line ends; modem lines are ignored.
                termios.make_raw();
                termios.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
                termios.control_modes -= ControlModes::CSTOPB | ControlModes::CRTSCTS;
                termios.set_speed(*baud)?;
                tcsetattr(&port, OptionalActions::Now, &termios)?;
                // Earlier bytes, possibly at another rate, are not a line.
                tcflush(&port, QueueSelector::IFlush)?;
                Ok(Link::Serial(port.into()))
            }
        }
    }

    /// Checks that the address can be read now.
    pub fn check(&self) -> io::Result<()> {
        self.open().map(drop)
    }
}

impl std::fmt::Display for LineAddress {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Udp(address) => write!(f, "udp://{address}"),
            Self::Serial { device, baud } => write!(f, "serial://{}?baud={baud}", device.display()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_survive_round_trip_and_others_are_refused() {
        for text in ["udp://0.0.0.0:10110", "serial:///dev/ttyUSB0?baud=9600"] {
            assert_eq!(text.parse::<LineAddress>().expect("is one").to_string(), text);
        }
        let default = "serial:///dev/ttyACM0".parse::<LineAddress>().expect("is one");
        assert_eq!(default, LineAddress::Serial { device: "/dev/ttyACM0".into(), baud: 115_200 });
        for text in
            ["", "udp://localhost:1", "udp://1.2.3.4", "serial://ttyUSB0", "serial:///dev/x?baud=0", "tcp://1.2.3.4:5"]
        {
            let error = text.parse::<LineAddress>().expect_err("is not an address");
            assert!(error.to_string().contains(&format!("value {text:?} must be udp://")), "{error}");
        }
    }
}
