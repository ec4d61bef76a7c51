"""A WebRTC connection that sends one track, from the offer to the end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from aiortc import RTCConfiguration, RTCIceServer, RTCPeerConnection, RTCRtpSender, RTCSessionDescription
from aiortc.sdp import candidate_from_sdp

from fleet.errors import WireError
from fleet.video.signals import IceCandidate
from fleet.video.track import CameraTrack

CONNECTED_WITHIN = 30.0  # s from the offer; the cloud keeps an offer no longer
MOST_EARLY = 50  # candidates kept before the answer; bounded, because any program may send them
CODEC = "video/H264"  # the only one offered: the media service might choose one that some browsers lack


class VideoPeer:
    """Sending side of one WebRTC connection; use it on the event loop only.

    ``ended`` is called once, with the reason, when the connection ends by itself; not after ``close``.
    """

    def __init__(
        self, track: CameraTrack, ice_servers: Sequence[RTCIceServer], ended: Callable[[str], None]
    ) -> None:
        self.track = track
        self._connection = RTCPeerConnection(RTCConfiguration(list(ice_servers)))
        self._ended = ended
        self._over = False
        self._answered = False
        self._early: list[IceCandidate] = []  # received before the answer
        self._connection.on("connectionstatechange", self._changed)
        track.on("ended", lambda: self._end(track.failure or "the camera's pictures ended"))
        video = self._connection.addTransceiver(track, "sendonly")
        codecs = RTCRtpSender.getCapabilities("video").codecs
        video.setCodecPreferences([codec for codec in codecs if codec.mimeType == CODEC])
        self._deadline = asyncio.get_running_loop().call_later(CONNECTED_WITHIN, self._late)

    @property
    def connected(self) -> bool:
        """True while pictures reach the peer."""
        return self._connection.connectionState == "connected"

    @property
    def ice_state(self) -> str:
        """ICE connection state, as named by WebRTC."""
        return self._connection.iceConnectionState

    async def offer(self) -> str:
        """Return the SDP of the offer, with all local candidates: aiortc has no event for one."""
        await self._connection.setLocalDescription(await self._connection.createOffer())
        return self._connection.localDescription.sdp

    async def answered(self, sdp: str) -> None:
        """Apply the answer; a second one is ignored. Raises WireError for an answer that cannot be used."""
        if self._connection.signalingState != "have-local-offer":
            return
        try:
            await self._connection.setRemoteDescription(RTCSessionDescription(sdp, "answer"))
        except Exception as error:  # noqa: BLE001 - aiortc's parser raises any kind of exception
            raise WireError(f"it cannot be used: {error!r}", where="answer") from None
        self._answered = True
        early, self._early = self._early, []
        for candidate in early:
            await self.add(candidate)

    async def add(self, candidate: IceCandidate) -> None:
        """Add a candidate of the peer; raises WireError for a candidate that cannot be used."""
        if not self._answered:
            self._early = [*self._early[1 - MOST_EARLY :], candidate]
        elif candidate.candidate:
            try:
                found = candidate_from_sdp(candidate.candidate)
                found.sdpMid, found.sdpMLineIndex = candidate.mid, candidate.index
                await self._connection.addIceCandidate(found)
            except Exception as error:  # noqa: BLE001 - as above
                raise WireError(f"it cannot be used: {error!r}", where="candidate") from None

    async def close(self) -> None:
        """Close the connection."""
        self._over = True
        self._deadline.cancel()
        self.track.stop()
        await self._connection.close()

    def _changed(self) -> None:
        """Handle a change of the connection state."""
        state = self._connection.connectionState
        if state == "connected":
            self._deadline.cancel()
        elif state in ("failed", "closed"):
            self._end(f"the connection is {state}")

    def _late(self) -> None:
        """Give up an offer that was not answered, or whose peer could not be reached, in time."""
        self._end(f"no peer was connected within {CONNECTED_WITHIN:g} s")

    def _end(self, why: str) -> None:
        """Report the end of the connection, once."""
        if not self._over:
            self._over = True
            self._ended(why)
