//! Awaits a future whose code stands once, however many places await it. The compiler would write it out in each of them:
//! with records in flash that is tens of kilobytes.

use core::pin::Pin;
use core::task::{Context, Poll};

/// Polls, and is never inlined.
#[inline(never)]
pub(crate) fn poll<F: Future>(future: Pin<&mut F>, context: &mut Context<'_>) -> Poll<F::Output> {
    future.poll(context)
}

/// Awaits the future of an expression by [`poll`].
macro_rules! apart {
    ($future:expr) => {
        // A match, so that what the expression borrows lives until the end.
        match $future {
            future => {
                let mut future = ::core::pin::pin!(future);
                ::core::future::poll_fn(|context| $crate::apart::poll(future.as_mut(), context)).await
            }
        }
    };
}

pub(crate) use apart;
