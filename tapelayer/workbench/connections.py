"""Connections: HTTP connections that are closed when the client neither sends nor reads in time."""

from __future__ import annotations

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

# For the whole head of a request, from the connection's start or the last answer.
HEAD_SECONDS = 20.0
# A body brings at least BODY_BYTES in each BODY_SECONDS.
BODY_SECONDS = 30.0
BODY_BYTES = 1024
# An answer of which the client reads nothing for so long is given up.
READ_SECONDS = 60.0


class Connection(H11Protocol):
    """uvicorn's connection with a time limit on whatever the client has to do.

    uvicorn's own limit on idle connections begins with the first answer and ends with the first byte of a request.
    """

    _phase: object = None
    _timer: asyncio.TimerHandle | None = None
    _reading: asyncio.TimerHandle | None = None
    _count = 0
    _counted = 0
    _unread = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin to wait for the first request."""
        super().connection_made(transport)
        self._expect()

    def data_received(self, data: bytes) -> None:
        """Take what the client sent."""
        self._count += len(data)
        super().data_received(data)
        self._expect()

    def on_response_complete(self) -> None:
        """Begin to wait for the next request."""
        super().on_response_complete()
        self._expect()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop waiting."""
        for timer in (self._timer, self._reading):
            if timer:
                timer.cancel()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        """Begin to wait for the client to read."""
        super().pause_writing()
        self._await_reader()

    def resume_writing(self) -> None:
        """Go on writing."""
        if self._reading:
            self._reading.cancel()
        super().resume_writing()

    def _expect(self) -> None:
        """Set the time limit on the phase that the request is in; a phase that goes on keeps its limit."""
        phase = self.conn.their_state
        if phase is self._phase or self.transport.is_closing():
            return
        self._phase = phase
        if self._timer:
            self._timer.cancel()
        self._timer = None
        if phase is h11.IDLE:
            self._timer = self.loop.call_later(HEAD_SECONDS, self.transport.close)
        elif phase is h11.SEND_BODY:
            self._await_body()

    def _await_body(self) -> None:
        self._counted = self._count
        self._timer = self.loop.call_later(BODY_SECONDS, self._judge_body)

    def _judge_body(self) -> None:
        """Close the connection unless its body goes on, or waits for us."""
        waits = self.flow.read_paused or self.conn.they_are_waiting_for_100_continue
        if waits or self._count - self._counted >= BODY_BYTES:
            self._await_body()
        else:
            self.transport.close()

    def _await_reader(self) -> None:
        # Nothing is written while writing is paused: less in the buffer is what the client has read.
        self._unread = self.transport.get_write_buffer_size()
        self._reading = self.loop.call_later(READ_SECONDS, self._judge_reader)

    def _judge_reader(self) -> None:
        """Give the answer up unless the client goes on reading."""
        if self.transport.get_write_buffer_size() < self._unread:
            self._await_reader()
        else:
            self.transport.abort()
