//! Link of a simulated robot on this computer: a socket that any number of programs join, like a bus.
//!
//! The socket carries the packets of a serial line ([`rollwalk_protocol::serial`]). The robot and all other programs receive
//! the frames that a program sends.

use crate::error::OpenError;
use crate::line::{SIMULATED, WAIT};
use crate::link::LinkError;
use crate::port::{Event, Inlet, Outlet, Port};
use crate::{priority, serial};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::Packet;
use rustix::io::Errno;
use rustix::net::{SendFlags, send};
use std::env;
use std::fs;
use std::io;
use std::net::Shutdown;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Maximum number of bytes buffered for a slow program: some seconds of traffic of a robot with twenty motors.
const WAITING: usize = 256 << 10;
/// Interval between attempts to send the buffered bytes.
const RETRY: Duration = Duration::from_millis(10);

/// Default socket of a simulated robot, in the user's runtime directory.
pub fn usual_socket() -> PathBuf {
    let folder = env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    folder.unwrap_or_else(env::temp_dir).join("rollwalk-sim.sock")
}

/// Joins the link of a simulated robot.
///
/// # Errors
/// Returns an error if no simulated robot listens on the socket.
pub fn connect(socket: Option<&Path>) -> Result<Port, OpenError> {
    let path = socket.map_or_else(usual_socket, Path::to_owned);
    let stream = UnixStream::connect(&path).and_then(|stream| {
        stream.set_read_timeout(Some(WAIT))?;
        stream.set_write_timeout(Some(WAIT))?;
        Ok((stream.try_clone()?, stream))
    });
    let (reader, writer) = stream.map_err(|error| {
        let what = format!("no simulated robot at {}: {error}", path.display());
        let name = socket.map_or("sim".into(), |path| format!("sim:{}", path.display()));
        OpenError {
            what,
            help: format!("start a simulated robot: rollwalk-sim ROBOT.toml --bus {name}"),
        }
    })?;
    Ok(serial::shared_port(SIMULATED, reader, writer))
}

/// Program that has joined.
struct Member {
    number: u64,
    stream: UnixStream,
    /// Bytes that the program has not accepted yet.
    waiting: Vec<u8>,
    retry: Instant,
}

impl Member {
    /// Sends bytes after those that are buffered.
    ///
    /// # Errors
    /// Returns an error if the program has ended, or if its buffer is full because it does not read.
    fn pass(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.waiting.extend_from_slice(bytes);
        if Instant::now() < self.retry {
            return if self.waiting.len() > WAITING {
                Err(io::ErrorKind::TimedOut.into())
            } else {
                Ok(())
            };
        }
        while !self.waiting.is_empty() {
            // Sending does not wait, because a program that does not read must not delay the others. Reading from the same
            // socket does wait.
            match send(&self.stream, &self.waiting, SendFlags::DONTWAIT) {
                Ok(count) => drop(self.waiting.drain(..count)),
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => {
                    self.retry = Instant::now() + RETRY;
                    return Ok(());
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

/// Programs that have joined.
type Members = Arc<Mutex<Vec<Member>>>;

/// Creates the link of a simulated robot, which programs can join. The socket is removed when the outlet is dropped.
///
/// # Errors
/// Returns an error if the socket cannot be created or another robot already uses it.
pub fn serve(socket: Option<&Path>) -> Result<Port, OpenError> {
    let path = socket.map_or_else(usual_socket, Path::to_owned);
    let failed = |error: io::Error| OpenError {
        what: format!("cannot create a socket at {}: {error}", path.display()),
        help: "give another path: --bus sim:PATH".into(),
    };
    if UnixStream::connect(&path).is_ok() {
        return Err(OpenError {
            what: format!("another simulated robot already uses {}", path.display()),
            help: "end the other robot, or give this one another path: --bus sim:PATH".into(),
        });
    }
    // Removes only a socket, left behind by a robot that was killed.
    match fs::symlink_metadata(&path) {
        Ok(found) if found.file_type().is_socket() => fs::remove_file(&path).map_err(failed)?,
        Ok(_) => {
            return Err(OpenError {
                what: format!("{} exists, but is not a socket", path.display()),
                help: "give a path at which no file exists: --bus sim:PATH".into(),
            });
        }
        Err(_) => {}
    }
    let listener = UnixListener::bind(&path).map_err(failed)?;
    let members = Members::default();
    let (sender, frames) = channel();
    let outlet = SimOutlet { path, members: Arc::clone(&members) };
    thread::spawn(move || accept(&listener, &members, &sender));
    Ok(Port { outlet: Box::new(outlet), inlet: Box::new(SimInlet { frames }) })
}

fn accept(listener: &UnixListener, members: &Members, to: &Sender<Frame>) {
    for (number, stream) in (0..).zip(listener.incoming()) {
        let joined = stream.and_then(|stream| {
            let reader = stream.try_clone()?;
            stream.set_nonblocking(false)?;
            let (waiting, retry) = (Vec::new(), Instant::now());
            let member = Member { number, stream, waiting, retry };
            members.lock().unwrap_or_else(PoisonError::into_inner).push(member);
            Ok(reader)
        });
        let Ok(reader) = joined else { continue };
        let (members, to) = (Arc::clone(members), to.clone());
        thread::spawn(move || {
            priority::raise();
            let mut inlet = serial::inlet("a program", reader);
            while let Ok(event) = inlet.next_event() {
                if let Some(Event::Frame(frame)) = event {
                    broadcast(&members, &frame, Some(number));
                    if to.send(frame).is_err() {
                        break;
                    }
                }
            }
            leave(&members, number);
        });
    }
}

/// Sends a frame to all programs except `but`.
fn broadcast(members: &Members, frame: &Frame, but: Option<u64>) {
    let Some(line) = Packet::Link(*frame).encode() else { return };
    let mut members = members.lock().unwrap_or_else(PoisonError::into_inner);
    members.retain_mut(|member| {
        if Some(member.number) == but || member.pass(&line).is_ok() {
            return true;
        }
        // A program that receives nothing must not go on sending.
        let _ = member.stream.shutdown(Shutdown::Both);
        false
    });
}

fn leave(members: &Members, number: u64) {
    let mut members = members.lock().unwrap_or_else(PoisonError::into_inner);
    members.retain(|member| member.number != number);
}

struct SimOutlet {
    path: PathBuf,
    members: Members,
}

impl Outlet for SimOutlet {
    fn is_free(&self) -> bool {
        true
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        broadcast(&self.members, frame, None);
        Ok(())
    }
}

impl Drop for SimOutlet {
    fn drop(&mut self) {
        // A socket that was removed already is no error.
        let _ = fs::remove_file(&self.path);
    }
}

struct SimInlet {
    frames: Receiver<Frame>,
}

impl Inlet for SimInlet {
    fn next_event(&mut self) -> Result<Option<Event>, LinkError> {
        match self.frames.recv_timeout(WAIT) {
            Ok(frame) => Ok(Some(Event::Frame(frame))),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                Err(LinkError::Down("the socket of the simulated robot failed".into()))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::LinkBus;
    use crate::port::LiveLink;
    use rollwalk_protocol::can::Frame;
    use std::io::Write;

    const LONG_US: u64 = 60_000_000;

    fn frame(id: u16) -> Frame {
        Frame::standard(id, &[1, 0]).unwrap()
    }

    #[test]
    fn programs_and_robot_hear_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("robot.sock");
        let mut robot = LiveLink::new(serve(Some(&socket)).unwrap());
        let mut first = LiveLink::new(connect(Some(&socket)).unwrap());
        first.send(&frame(1)).unwrap();
        assert_eq!(robot.receive(LONG_US), Ok(Some(frame(1))));
        let mut second = LiveLink::new(connect(Some(&socket)).unwrap());
        second.send(&frame(2)).unwrap();
        assert_eq!(robot.receive(LONG_US), Ok(Some(frame(2))));
        assert_eq!(first.receive(LONG_US), Ok(Some(frame(2))));
        robot.send(&frame(3)).unwrap();
        assert_eq!(first.receive(LONG_US), Ok(Some(frame(3))));
        assert_eq!(second.receive(LONG_US), Ok(Some(frame(3))));
    }

    #[test]
    fn a_file_that_is_no_socket_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("pup.toml");
        fs::write(&file, "name = \"pup\"").unwrap();
        let error = serve(Some(&file)).err().unwrap();
        assert!(error.what.contains("pup.toml exists, but is not a socket"), "{error}");
        assert_eq!(fs::read_to_string(&file).unwrap(), "name = \"pup\"");
    }

    #[test]
    fn a_program_that_does_not_listen_is_put_out_and_not_heard_any_more() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("robot.sock");
        let mut robot = LiveLink::new(serve(Some(&socket)).unwrap());
        // A program that has stopped reading.
        let mut deaf = UnixStream::connect(&socket).unwrap();
        deaf.write_all(&Packet::Link(frame(1)).encode().unwrap()).unwrap();
        assert_eq!(robot.receive(LONG_US), Ok(Some(frame(1))));
        let is_out =
            |deaf: &mut UnixStream| deaf.write_all(&Packet::Ask.encode().unwrap()).is_err();
        for sent in 0.. {
            robot.send(&frame(3)).unwrap();
            if is_out(&mut deaf) {
                break;
            }
            assert!(sent < 1_000_000, "it is never put out");
        }
    }

    #[test]
    fn a_socket_left_behind_is_taken_over_and_one_in_use_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let socket = folder.path().join("robot.sock");
        drop(UnixListener::bind(&socket).unwrap());
        assert!(socket.exists());
        let error = connect(Some(&socket)).err().unwrap();
        assert!(error.help.contains("rollwalk-sim ROBOT.toml --bus sim:"), "{error}");
        let robot = serve(Some(&socket)).unwrap();
        let error = serve(Some(&socket)).err().unwrap();
        assert!(error.what.contains("another simulated robot"), "{error}");
        drop(robot);
        assert!(!socket.exists());
    }
}
