#include "board.h"
#include "firmware.h"

int main(void)
{
    board_init();
    firmware_init();
    board_mask(0);
    for (;;) {
        firmware_poll();
    }
}
