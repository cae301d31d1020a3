//! CAN: FDCAN 1 at 250 kbit/s (J1939-11), with queues that its interrupts fill and empty.

use embassy_stm32::Peri;
use embassy_stm32::can::config::{GlobalFilter, NonMatchingFilter};
use embassy_stm32::can::{
    BufferedCanReceiver, BufferedCanSender, CanConfigurator, IT0InterruptHandler, IT1InterruptHandler, RxBuf,
    TxBuf, frame,
};
use embassy_stm32::interrupt::typelevel::{self, Binding};
use embassy_stm32::peripherals::{FDCAN1, PA11, PA12};
use kou_app::controller::CanPort;
use kou_app::j1939::Frame;
use static_cell::ConstStaticCell;

/// Bit rate of J1939-11, and of most vehicles.
const BIT_RATE: u32 = 250_000;
/// Frames that may wait in either direction: what comes in one turn of the task that takes them, with a margin.
const QUEUE: usize = 16;

static TO_BUS: ConstStaticCell<TxBuf<QUEUE>> = ConstStaticCell::new(TxBuf::new());
static FROM_BUS: ConstStaticCell<RxBuf<QUEUE>> = ConstStaticCell::new(RxBuf::new());

/// The controller's end of the bus.
pub(crate) struct FdcanPort {
    sender: BufferedCanSender,
    receiver: BufferedCanReceiver,
}

impl FdcanPort {
    /// Starts the peripheral, once: a second time there are no queues left.
    pub(crate) fn new(
        can: Peri<'static, FDCAN1>,
        receive: Peri<'static, PA11>,
        send: Peri<'static, PA12>,
        irqs: impl Binding<typelevel::FDCAN1_IT0, IT0InterruptHandler<FDCAN1>>
        + Binding<typelevel::FDCAN1_IT1, IT1InterruptHandler<FDCAN1>>
        + 'static,
    ) -> Option<Self> {
        let (to_bus, from_bus) = (TO_BUS.try_take()?, FROM_BUS.try_take()?);
        let mut configurator = CanConfigurator::new(can, receive, send, irqs);
        configurator.set_bitrate(BIT_RATE);
        // Frames of 11 bits and remote frames are not J1939's, and are not worth an interrupt.
        let filter = GlobalFilter::reject_all().set_handle_extended_frames(NonMatchingFilter::IntoRxFifo0);
        configurator.set_config(configurator.config().set_global_filter(filter));
        let buffered = configurator.into_normal_mode().buffered(to_bus, from_bus);
        Some(Self { sender: buffered.writer(), receiver: buffered.reader() })
    }
}

impl CanPort for FdcanPort {
    fn receive(&mut self) -> Option<Frame> {
        // Errors of the bus come in the same queue; what they mean is seen in the frames that do not come.
        while let Ok(come) = self.receiver.try_receive() {
            if let Some(frame) = come.ok().and_then(|envelope| Frame::from_can(&envelope.frame)) {
                return Some(frame);
            }
        }
        None
    }

    fn send(&mut self, frame: &Frame) -> bool {
        let frame: Option<frame::Frame> = frame.to_can();
        frame.is_some_and(|frame| self.sender.try_write(frame).is_ok())
    }
}
