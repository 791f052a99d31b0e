//! Transfer of a motion library: BEGIN, blocks, FINISH, ACTIVATE.
//!
//! A block that is lost or damaged is repeated at half the size: one lost frame of a long message
//! loses the whole message, so on a bad link short messages are more likely to arrive. With every
//! block that arrives the blocks grow again.

use super::{Session, SessionError, ask_hello};
use rollwalk_bus::link::LinkBus;
use rollwalk_protocol::crc::file_digest;
use rollwalk_protocol::library::identity;
use rollwalk_protocol::wire::transport::{MAX_BLOCK, Reply, Request, Response, TransferResult};

/// Timeout of a block, µs.
const BLOCK_TIMEOUT_US: u64 = 250_000;
/// Timeout of requests that erase or read memory, µs.
const MEMORY_TIMEOUT_US: u64 = 5_000_000;
/// Largest number of transmissions of a request other than a block.
const REQUEST_SENDS: u32 = 5;
/// Smallest size of a block, and step by which blocks grow, bytes.
const SMALLEST_BLOCK: usize = 32;
/// Number of blocks in a row without progress after which the transfer is given up.
const LOST_BLOCKS: u32 = 16;

/// Progress of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Bytes that the controller has received.
    pub done: usize,
    /// Size of the library, bytes.
    pub total: usize,
}

impl<B: LinkBus> Session<B> {
    /// Transfers, checks and activates a library; the controller must be disarmed. `progress` is called after every
    /// block. An interrupted transfer resumes where it stopped.
    pub fn flash(
        &mut self,
        library: &[u8],
        mut progress: impl FnMut(Progress),
    ) -> Result<(), SessionError> {
        let digest = file_digest(library);
        let len = u32::try_from(library.len()).unwrap_or(u32::MAX);
        let begun = self.transfer(&Request::Begin { len, digest }, len, MEMORY_TIMEOUT_US)?;
        self.send_blocks(library, begun.next as usize, &mut progress)?;
        self.transfer(&Request::Finish, len, MEMORY_TIMEOUT_US)?;
        self.transfer(&Request::Activate { digest }, len, MEMORY_TIMEOUT_US)?;
        self.hello = ask_hello(&mut self.exchange)?;
        let found = self.hello.library;
        if found == identity(library) { Ok(()) } else { Err(SessionError::NotInUse { found }) }
    }

    /// Sends the rest of the library, from byte `done` on.
    fn send_blocks(
        &mut self,
        library: &[u8],
        mut done: usize,
        progress: &mut impl FnMut(Progress),
    ) -> Result<(), SessionError> {
        let total = library.len();
        let largest = usize::from(self.hello.max_block).clamp(1, MAX_BLOCK);
        let smallest = SMALLEST_BLOCK.min(largest);
        let mut size = largest;
        let mut lost = 0;
        while done < total {
            progress(Progress { done, total });
            let bytes = &library[done..total.min(done + size)];
            let block = Request::Block { offset: done as u32, bytes };
            let wanted = reply_to(&block, total as u32);
            let reply = self.exchange.respond_once(&block, BLOCK_TIMEOUT_US, wanted)?;
            let next = match reply {
                None => done,
                Some(Reply {
                    result: TransferResult::Ok | TransferResult::OutOfOrder | TransferResult::BadCrc,
                    next,
                    ..
                }) => next as usize,
                Some(reply) => return Err(SessionError::LibraryRefused { reply }),
            };
            if next > done {
                lost = 0;
                size = largest.min(size + SMALLEST_BLOCK);
            } else {
                lost += 1;
                size = smallest.max(size / 2);
            }
            if lost == LOST_BLOCKS {
                return Err(self.exchange.silent("transfer"));
            }
            done = next;
        }
        progress(Progress { done, total });
        Ok(())
    }

    /// Sends a transfer request; any answer but `Ok` is an error.
    fn transfer(
        &mut self,
        request: &Request<'_>,
        len: u32,
        timeout_us: u64,
    ) -> Result<Reply, SessionError> {
        let wanted = reply_to(request, len);
        let reply = self.exchange.respond(request, timeout_us, REQUEST_SENDS, wanted)?;
        match reply.result {
            TransferResult::Ok => Ok(reply),
            _ => Err(SessionError::LibraryRefused { reply }),
        }
    }
}

/// Selects the answer to a request about a file of `len` bytes. An answer with `next` beyond the end belongs to
/// another file or is damaged, and counts as lost.
fn reply_to(request: &Request<'_>, len: u32) -> impl FnMut(Response) -> Option<Reply> + use<> {
    let kind = request.kind();
    move |response| match response {
        Response::Reply(reply) if reply.request == kind => {
            let goes_on = matches!(
                reply.result,
                TransferResult::Ok | TransferResult::OutOfOrder | TransferResult::BadCrc
            );
            (!goes_on || reply.next <= len).then_some(reply)
        }
        _ => None,
    }
}
