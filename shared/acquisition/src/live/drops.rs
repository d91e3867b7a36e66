//! Packets that the kernel dropped because the receive buffer was full.

use std::net::UdpSocket;

/// The kernel's table of UDP sockets.
const TABLE: &str = "/proc/net/udp";

/// Number of packets that a socket has dropped since it was bound; `None` if the kernel does not report it.
pub(crate) fn dropped(socket: &UdpSocket) -> Option<u64> {
    let inode = rustix::fs::fstat(socket).ok()?.st_ino;
    parse_drops(&std::fs::read_to_string(TABLE).ok()?, inode)
}

/// Column `drops` of the line with the socket's inode.
fn parse_drops(table: &str, inode: u64) -> Option<u64> {
    let columns = |line: &str| -> Option<(u64, u64)> {
        let mut columns = line.split_whitespace();
        Some((columns.nth(9)?.parse().ok()?, columns.nth(2)?.parse().ok()?))
    };
    table.lines().filter_map(columns).find(|(of, _)| *of == inode).map(|(_, drops)| drops)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_over_the_receive_buffer_are_counted_as_dropped() {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("binds");
        // Every Linux with procfs has the table. Without it the stage cannot report drops, and this test must fail.
        assert_eq!(dropped(&socket), Some(0), "{TABLE}");
        let sender = UdpSocket::bind("127.0.0.1:0").expect("binds");
        let address = socket.local_addr().expect("bound");
        // Far more than any default buffer size.
        let n_sent = 20_000;
        for _ in 0..n_sent {
            sender.send_to(&[0; 1206], address).expect("sends");
        }
        socket.set_nonblocking(true).expect("sets");
        let mut n_received = 0;
        while socket.recv(&mut [0; 2048]).is_ok() {
            n_received += 1;
        }
        assert!(n_received < n_sent);
        assert_eq!(dropped(&socket), Some(n_sent - n_received));
    }
}
