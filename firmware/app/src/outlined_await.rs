//! Await through a function that is never inlined, so that the code of a future exists once however many places await it.
//!
//! The compiler would inline the state machine at every `.await`; for records in flash that is tens of kilobytes.

use core::pin::Pin;
use core::task::{Context, Poll};

/// Polls a future; never inlined.
#[inline(never)]
pub(crate) fn poll<F: Future>(future: Pin<&mut F>, context: &mut Context<'_>) -> Poll<F::Output> {
    future.poll(context)
}

/// Awaits the future of an expression by [`poll`].
macro_rules! await_outlined {
    ($future:expr) => {
        // A `match` keeps the temporaries that the expression borrows alive until the end.
        match $future {
            future => {
                let mut future = ::core::pin::pin!(future);
                ::core::future::poll_fn(|context| $crate::outlined_await::poll(future.as_mut(), context))
                    .await
            }
        }
    };
}

pub(crate) use await_outlined;
